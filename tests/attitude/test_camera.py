from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from posse_core._attitude.camera import PointingErrorLaw, TrackLaw, looking_at_target
from posse_core._attitude.options import PointingErrorOptions, TrackOptions
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._frames import unit
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings

coordinate = st.floats(-1e3, 1e3).map(lambda x: 0.0 if abs(x) < 1e-6 else x)
position = st.tuples(coordinate, coordinate, coordinate).map(np.array)
RING_M = 20 * np.stack([np.cos(np.arange(60)), np.sin(np.arange(60)), 0.3 * np.ones(60)], axis=-1)
RING, FIRST = np.arange(60), np.zeros(1, dtype=int)


def R_rtn_from_camera(
    law: AttitudeLaw, r_rtn_m: np.ndarray, indices: np.ndarray, seed: int
) -> np.ndarray:
    """The attitude beside a target whose RTN axes are ECI's."""
    x, y = np.tile(np.eye(3)[:2, None], (1, len(indices), 1))
    sun_m = np.array([0.0, 0.0, 1.5e11])
    return law.attitude(
        Surroundings(
            subject="camera",
            epoch=Epoch.from_iso("2022-01-31T02:02:27.58"),
            seed=seed,
            t_s=np.zeros(len(indices)),
            indices=indices,
            r_target_eci_m=7.1e6 * x,
            v_target_eci_m_s=7.5e3 * y,
            r_sun_eci_m=np.tile(sun_m, (len(indices), 1)),
            r_sun_epoch_eci_m=sun_m,
            r_chaser_rtn_m=r_rtn_m,
        )
    )


def track(offset: float) -> TrackLaw:
    return TrackLaw(TrackOptions(offset=offset))


@given(r_m=position)
def test_boresight_meets_the_target_and_n_is_up(r_m: np.ndarray) -> None:
    assume(np.linalg.norm(r_m) > 0)
    R = looking_at_target(r_m[None], FIRST)[0]
    target_cam = R.T @ -r_m
    np.testing.assert_allclose(target_cam, [0, 0, np.linalg.norm(r_m)], atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-12)
    normal_cam = R.T @ np.array([0, 0, 1.0])
    assert normal_cam[0] == pytest.approx(0, abs=2e-6)
    assert normal_cam[1] < 2e-6  # image y is down


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_along_the_normal_r_is_up(side: float) -> None:
    for sideways in (0.0, 1e-300, 1e-7, -1e-8):
        R = looking_at_target(np.array([[sideways, 0.0, 10 * side]]), FIRST)[0]
        np.testing.assert_allclose(R.T @ np.array([1.0, 0, 0]), [0, -1, 0], atol=1e-7)


def test_without_an_offset_the_camera_looks_at_the_target() -> None:
    exact = R_rtn_from_camera(TrackLaw(TrackOptions()), RING_M, RING, seed=3)
    np.testing.assert_allclose(exact, looking_at_target(RING_M, RING), atol=1e-13)


def test_pull_is_a_share_of_the_turn_from_rest() -> None:
    """Blender's constraint is a spherical interpolation between the resting and the aimed rotation."""
    R = R_rtn_from_camera(track(0.02), RING_M, RING, seed=3)
    rest = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))
    shares = []
    for aimed, pulled in zip(looking_at_target(RING_M, RING), R, strict=True):
        whole = (rest.inv() * Rotation.from_matrix(aimed)).magnitude()
        left = (Rotation.from_matrix(pulled).inv() * Rotation.from_matrix(aimed)).magnitude()
        shares.append(left / whole)
        between = Slerp([0, 1], Rotation.concatenate([rest, Rotation.from_matrix(aimed)]))
        np.testing.assert_allclose(between(1 - left / whole).as_matrix(), pulled, atol=1e-12)
    assert 0 <= min(shares) < 0.004
    assert 0.016 < max(shares) <= 0.02
    assert np.mean(shares) == pytest.approx(0.01, abs=0.003)


def test_a_frame_draws_from_seed_and_its_number_alone() -> None:
    whole = R_rtn_from_camera(track(0.02), RING_M, RING, seed=3)
    np.testing.assert_array_equal(
        R_rtn_from_camera(track(0.02), RING_M[:9], RING[:9], seed=3), whole[:9]
    )
    other = R_rtn_from_camera(track(0.02), RING_M, RING, seed=4)
    assert np.abs(other - whole).max() > 1e-3


def test_the_camera_at_the_target_is_refused() -> None:
    with pytest.raises(InputError, match="at the target at frame 8"):
        looking_at_target(np.array([[1.0, 0, 0], [0.0, 0, 0]]), np.array([7, 8]))


@given(r_m=position, offset=st.floats(0, 1))
def test_never_nan(r_m: np.ndarray, offset: float) -> None:
    assume(np.linalg.norm(r_m) > 0)
    R = R_rtn_from_camera(track(offset), r_m[None], FIRST, seed=0)[0]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.all(np.isfinite(unit(R[:, 2])))


def test_a_misalignment_moves_the_target_in_the_image() -> None:
    # Turned to the right about y (down) by 2°, the camera sees the target 2° to the left.
    R = R_rtn_from_camera(
        PointingErrorLaw(PointingErrorOptions(bias_deg=(0, 2, 0))), RING_M, RING, seed=0
    )
    target_cam = unit(np.einsum("fji,fj->fi", R, -RING_M))
    np.testing.assert_allclose(np.degrees(np.arctan2(target_cam[:, 0], target_cam[:, 2])), -2, atol=1e-9)
    np.testing.assert_allclose(target_cam[:, 1], 0, atol=1e-12)


def test_jitter_has_the_given_spread_about_each_axis() -> None:
    places = np.tile([[0.0, 30.0, 0.0]], (3000, 1))
    indices = np.arange(len(places))
    R = R_rtn_from_camera(
        PointingErrorLaw(PointingErrorOptions(jitter_deg=(0.1, 0.3, 0.5))), places, indices, seed=1
    )
    aimed = Rotation.from_matrix(looking_at_target(places, indices))
    turns = aimed.inv() * Rotation.from_matrix(R)
    spread = np.degrees(turns.as_rotvec()).std(axis=0)
    # Three standard errors of a standard deviation from 3000 draws are 4 %.
    np.testing.assert_allclose(spread, [0.1, 0.3, 0.5], rtol=0.04)
    assert np.abs(np.degrees(turns.as_rotvec()).mean(axis=0)).max() < 0.03
