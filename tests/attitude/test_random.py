"""Random attitudes are spread as they say, by tests against exact distributions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from posse_core._arrays import FloatArray
from posse_core._attitude.camera import RandomPointingLaw, looking_at_target
from posse_core._attitude.options import RandomPointingOptions
from posse_core._attitude.target import RandomLaw
from posse_core._frames import unit
from posse_core._interfaces.attitude_law import AttitudeLaw
from posse_core._plugins.options import NoOptions
from posse_core._scenario.attitude import Subject
from posse_core.testing.attitude_laws import surroundings

FRAMES = 3000
LEAST_P = 1e-3
"""The draws are the same in every run, so a test that passes once passes always."""


def attitudes(law: AttitudeLaw, subject: Subject) -> FloatArray:
    return law.attitude(surroundings(subject, np.linspace(0, 6000, FRAMES)))


def assert_uniform_over_rotations(R: FloatArray) -> None:
    """Angle and axis of a uniform rotation: (angle − sin angle) / π is even on 0 … 1 and the axis on
    the sphere, whose coordinates are even on −1 … 1 (Archimedes). The images of fixed directions are
    even on the sphere too."""
    vectors = Rotation.from_matrix(R).as_rotvec()
    angle = np.linalg.norm(vectors, axis=1)
    assert stats.kstest((angle - np.sin(angle)) / np.pi, "uniform").pvalue > LEAST_P
    for coordinate in (*unit(vectors).T, *R[:, :, 0].T, *R[:, :, 2].T):
        assert stats.kstest((coordinate + 1) / 2, "uniform").pvalue > LEAST_P


def test_every_attitude_of_the_target_is_equally_likely() -> None:
    assert_uniform_over_rotations(attitudes(RandomLaw(NoOptions()), "target"))


def test_a_camera_that_may_point_anywhere_has_any_attitude() -> None:
    law = RandomPointingLaw(RandomPointingOptions(off_axis_deg=(0, 180)))
    assert_uniform_over_rotations(attitudes(law, "camera"))


@pytest.mark.parametrize("limits_deg", [(0, 8), (5, 12), (90, 180)])
def test_the_target_is_off_the_boresight_evenly_within_the_limits(
    limits_deg: tuple[float, float],
) -> None:
    around = surroundings("camera", np.linspace(0, 6000, FRAMES))
    law = RandomPointingLaw(RandomPointingOptions(off_axis_deg=limits_deg))
    R_eci_from_cam = law.attitude(around)
    chaser = around.r_chaser_rtn_m
    r, v = around.r_target_eci_m, around.v_target_eci_m_s
    normal = unit(np.cross(r, v))
    R_eci_from_rtn = np.stack([unit(r), np.cross(normal, unit(r)), normal], axis=-1)
    to_target = -np.einsum("fij,fj->fi", R_eci_from_rtn, unit(chaser))
    x, y, z = np.einsum("fji,fj->if", R_eci_from_cam, to_target)
    low, high = np.cos(np.radians(limits_deg[::-1]))
    assert stats.kstest((z - low) / (high - low), "uniform").pvalue > LEAST_P
    assert stats.kstest(np.arctan2(y, x) / (2 * np.pi) + 0.5, "uniform").pvalue > LEAST_P
    # The roll about the line of sight, from the aimed camera's, is even over a full turn.
    aimed = R_eci_from_rtn @ looking_at_target(chaser, around.indices)
    turn = Rotation.from_matrix(np.swapaxes(aimed, -1, -2) @ R_eci_from_cam)
    roll = turn.as_euler("ZXZ")
    assert stats.kstest((roll[:, 0] + roll[:, 2]) / (2 * np.pi) % 1, "uniform").pvalue > LEAST_P


def test_without_an_angle_the_camera_looks_at_the_target() -> None:
    around = surroundings("camera", np.linspace(0, 6000, 50))
    R = RandomPointingLaw(RandomPointingOptions()).attitude(around)
    r, v = around.r_target_eci_m, around.v_target_eci_m_s
    normal = unit(np.cross(r, v))
    R_eci_from_rtn = np.stack([unit(r), np.cross(normal, unit(r)), normal], axis=-1)
    boresight = np.einsum("fij,fj->fi", R_eci_from_rtn, -unit(around.r_chaser_rtn_m))
    np.testing.assert_allclose(R[:, :, 2], boresight, atol=1e-9)
