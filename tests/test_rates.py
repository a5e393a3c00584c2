"""Rates of turn in the trajectory, and the frame a moment later that they lead to."""

from operator import attrgetter

import numpy as np
import pytest
from laws import laws_of
from scipy.spatial.transform import Rotation

from posse_core._constants import Constants
from posse_core._frames import matrix_from_quaternion
from posse_core._plugins.options import Options
from posse_core._propagators.roe import RoePropagator
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig
from posse_core._trajectory.attitude import Laws
from posse_core._trajectory.build import build_trajectory
from posse_core._trajectory.problem import resolve
from posse_core._trajectory.state import frame_state

ORBIT = OrbitConfig(
    elements={
        "epoch_utc": "2022-01-31T02:02:27.58",
        "a_m": 7.1e6,
        "e": 0.01,
        "i_deg": 98.0,
        "raan_deg": 10.0,
        "argp_deg": 20.0,
        "mean_anomaly_deg": 30.0,
    }
)


def build(laws: Laws, t_s: list[float]):
    problem = resolve(
        orbit=ORBIT,
        relative=RelativeConfig(roe_m=(0, 100, 60, 0, 60, 0)),
        t_s=np.array(t_s),
        constants=Constants(),
    )
    return build_trajectory(
        propagator=RoePropagator(Options()), problem=problem, laws=laws, seed=0, name="roe"
    )


def test_a_spin_turns_at_its_rate_about_its_axis() -> None:
    law = {"law": "spin", "body_axis": "+y", "rate_rpm": 15.0}
    omega = build(laws_of(target=law), [0.0, 1e5]).omega_body_rad_s
    np.testing.assert_allclose(omega, np.tile([0, np.pi / 2, 0], (2, 1)), atol=1e-7)


def test_a_nadir_craft_turns_once_an_orbit() -> None:
    """Body +y is against the orbit's normal, and the orbit turns at h/r²."""
    trajectory = build(laws_of(target="nadir"), [0.0, 700.0])
    r, v = trajectory.r_target_eci_m, trajectory.v_target_eci_m_s
    rate = np.linalg.norm(np.cross(r, v), axis=1) / np.sum(r**2, axis=1)
    expected = np.stack([0 * rate, -rate, 0 * rate], axis=1)
    np.testing.assert_allclose(trajectory.omega_body_rad_s, expected, atol=1e-9)


def test_a_tumbling_body_starts_with_the_rate_it_is_given() -> None:
    law = {"law": "tumbling", "moments_kg_m2": (100, 200, 250), "rate_body_deg_s": (3, -4, 5)}
    omega = build(laws_of(target=law), [0.0]).omega_body_rad_s
    np.testing.assert_allclose(omega, np.radians([[3, -4, 5]]), atol=1e-7)


@pytest.mark.parametrize(
    "camera",
    [{"law": "track", "offset": 0.02}, {"law": "pointing-error", "jitter_deg": (0.1, 0.1, 0.1)}],
)
def test_a_frame_a_moment_later_is_the_trajectorys_frame_of_then(camera) -> None:
    """Against a propagation to that instant; where the law draws anew, the same frame number's."""
    laws = laws_of(target="spin", camera=camera)
    after_s = 0.05
    moved = frame_state(build(laws, [100.0]), 0, Constants()).after(after_s)
    then = frame_state(build(laws, [100.0 + after_s]), 0, Constants())
    for name, atol in (
        ("craft.R_cam_from_body", 1e-8),
        ("craft.t_body_cam_m", 1e-6),
        ("craft.sun_direction_cam", 2e-8),  # the Earth moves about the Sun by 1e-8 rad meanwhile
        ("R_cam_from_eci", 1e-8),
        ("R_ecef_from_eci", 1e-9),
        ("r_camera_eci_m", 0.02),
        ("r_target_eci_m", 0.02),
        ("epoch_jd_tt", 1e-9),
    ):
        np.testing.assert_allclose(attrgetter(name)(moved), attrgetter(name)(then), rtol=0, atol=atol)


def test_rates_agree_with_the_attitudes_beside_them() -> None:
    """A camera on a close fly-by; Scipy's rotation vector between two frames of the trajectory."""
    trajectory = build(laws_of(camera="track"), [50.0, 50.1])
    for omega, q in (
        (trajectory.omega_body_rad_s, trajectory.q_eci_from_body),
        (trajectory.omega_camera_rad_s, trajectory.q_eci_from_camera),
    ):
        R = matrix_from_quaternion(q)
        turned = Rotation.from_matrix(R[0].T @ R[1]).as_rotvec() / 0.1
        np.testing.assert_allclose(omega.mean(axis=0), turned, atol=1e-8)
        assert np.linalg.norm(turned) > 1e-4
