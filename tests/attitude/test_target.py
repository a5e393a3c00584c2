from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._arrays import FloatArray
from posse_core._attitude.options import (
    BodyAxis,
    InertialOptions,
    NedOptions,
    SpinOptions,
    SunPointingOptions,
    TrackingOptions,
    TumblingOptions,
)
from posse_core._attitude.target import (
    InertialLaw,
    NadirLaw,
    NedLaw,
    SpinLaw,
    SunPointingLaw,
    TrackingLaw,
    TumblingLaw,
    body_axes,
)
from posse_core._environment.ephemeris import ECLIPTIC_NORTH_ECI, sun_eci_m
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._frames import eci_from_rtn, unit
from posse_core._interfaces.attitude_law import AttitudeLaw, Surroundings
from posse_core._plugins.options import NoOptions

RATE_RAD_S = 1.06e-3
SUN_M = np.array([96.4e9, -102.3e9, -44.3e9])
AXES: tuple[BodyAxis, ...] = ("+x", "-x", "+y", "-y", "+z", "-z")


def surroundings(
    t_s: FloatArray, inclination_rad: float = 1.7, e_v: float = 1.0, sun_m: FloatArray = SUN_M
) -> Surroundings:
    """A target on a circle of 7 100 km; ``e_v`` tilts its velocity outward as on an ellipse."""
    u = RATE_RAD_S * t_s
    x, y = np.array([1.0, 0, 0]), np.array([0, np.cos(inclination_rad), np.sin(inclination_rad)])
    r = 7.1e6 * (np.cos(u)[:, None] * x + np.sin(u)[:, None] * y)
    v = 7.5e3 * (-np.sin(u)[:, None] * x + np.cos(u)[:, None] * y) + (e_v - 1) * r * 1e-3
    return Surroundings(
        subject="target",
        seed=0,
        epoch=Epoch.from_iso("2022-01-31T02:02:27.58"),
        t_s=t_s,
        indices=np.arange(len(t_s)),
        r_target_eci_m=r,
        v_target_eci_m_s=v,
        r_sun_eci_m=np.broadcast_to(sun_m, r.shape),
        r_sun_epoch_eci_m=sun_m,
        r_chaser_rtn_m=np.stack([10 * np.cos(u), -20 * np.sin(u), 3 * np.cos(u)], axis=-1),
    )


T_S = np.linspace(0, 5900, 24)

LAWS: list[AttitudeLaw] = [
    NadirLaw(NoOptions()),
    SunPointingLaw(SunPointingOptions(body_axis="-y")),
    InertialLaw(InertialOptions(q_eci_from_body=(0.1, 0.2, -3.0, 0.4))),
    SpinLaw(SpinOptions(body_axis="-x", rate_rpm=-2, sun_angle_deg=40)),
    NedLaw(NedOptions()),
    NedLaw(NedOptions(down="sun")),
    TrackingLaw(TrackingOptions(body_axis="+x")),
    TumblingLaw(
        TumblingOptions(moments_kg_m2=(3, 4, 5), rate_body_deg_s=(1, 2, 3), q_eci_from_body=(1, 2, 3, 4))
    ),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_every_law_gives_rotations_that_do_not_depend_on_other_frames(law: AttitudeLaw) -> None:
    R = law.attitude(surroundings(T_S))
    np.testing.assert_allclose(
        R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-14)
    alone = law.attitude(surroundings(T_S[7:8]))
    np.testing.assert_array_equal(alone[0], R[7])


@pytest.mark.parametrize("e_v", [1.0, 2.0])
def test_nadir_is_lvlh(e_v: float) -> None:
    around = surroundings(T_S, e_v=e_v)
    body = np.moveaxis(NadirLaw(NoOptions()).attitude(around), -1, 0)
    momentum = unit(np.cross(around.r_target_eci_m, around.v_target_eci_m_s))
    np.testing.assert_allclose(body[2], -unit(around.r_target_eci_m), atol=1e-14)
    np.testing.assert_allclose(body[1], -momentum, atol=1e-14)
    # V-bar is square to R-bar on the velocity's side, not the velocity itself.
    assert np.all(np.sum(body[0] * around.v_target_eci_m_s, axis=-1) > 0)
    if e_v == 1.0:
        np.testing.assert_allclose(body[0], unit(around.v_target_eci_m_s), atol=1e-12)


def test_nadir_turns_evenly_once_an_orbit_where_ned_does_not() -> None:
    fine_s = np.arange(0.0, 5900.0, 5.0)
    around = surroundings(fine_s)

    def largest_rate_rad_s(law: AttitudeLaw) -> float:
        R = law.attitude(around)
        steps = np.swapaxes(R[:-1], -1, -2) @ R[1:]
        cosine = (np.trace(steps, axis1=-2, axis2=-1) - 1) / 2
        return float(np.arccos(cosine).max() / 5.0)

    assert largest_rate_rad_s(NadirLaw(NoOptions())) == pytest.approx(RATE_RAD_S, rel=1e-6)
    assert largest_rate_rad_s(NedLaw(NedOptions())) > 5 * RATE_RAD_S


@pytest.mark.parametrize("axis", AXES)
def test_sun_pointing_holds_the_named_axis_on_the_sun(axis: BodyAxis) -> None:
    around = surroundings(T_S)
    R = SunPointingLaw(SunPointingOptions(body_axis=axis)).attitude(around)
    pointing, following = body_axes(axis)
    np.testing.assert_allclose(R @ pointing, unit(SUN_M - around.r_target_eci_m), atol=1e-14)
    # The next axis leans to ecliptic north, which is square to the Sun within its parallax.
    assert np.all((R @ following) @ ECLIPTIC_NORTH_ECI > 0.999)


def test_ecliptic_north_is_square_to_the_sun_all_year() -> None:
    days = np.arange(0.0, 366.0, 10.0)
    sun = unit(sun_eci_m(np.full(days.shape, 2459580.5), days))
    assert np.abs(sun @ ECLIPTIC_NORTH_ECI).max() < 1e-4


@pytest.mark.parametrize("sun_angle_deg", [20.0, 90.0, 135.0])
def test_spin_keeps_its_axis_at_the_angle_from_the_sun(sun_angle_deg: float) -> None:
    R = SpinLaw(SpinOptions(sun_angle_deg=sun_angle_deg)).attitude(surroundings(T_S))
    axis = R @ np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(axis, np.broadcast_to(axis[0], axis.shape), atol=1e-14)
    assert np.degrees(np.arccos(axis[0] @ unit(SUN_M))) == pytest.approx(sun_angle_deg, abs=1e-9)


def test_spin_of_15_rpm_turns_right_handed_in_4_seconds() -> None:
    R = SpinLaw(SpinOptions()).attitude(surroundings(np.array([0.0, 1.0, 2.0, 4.0, 4e6])))
    x, y = R[0] @ np.array([1.0, 0, 0]), R[0] @ np.array([0, 1.0, 0])
    # At the epoch and phase 0 the x axis is at the Sun, as the spin axis is square to it.
    np.testing.assert_allclose(x, unit(SUN_M), atol=1e-14)
    np.testing.assert_allclose(R[1:] @ np.array([1.0, 0, 0]), [y, -x, x, x], atol=1e-9)


def test_spin_phase_is_a_turn_about_the_axis() -> None:
    later = SpinLaw(SpinOptions(rate_rpm=10, phase_deg=30)).attitude(surroundings(np.array([0.0])))
    # 10 rpm is 60° a second.
    earlier = SpinLaw(SpinOptions(rate_rpm=10)).attitude(surroundings(np.array([0.5])))
    np.testing.assert_allclose(later, earlier, atol=1e-14)


def test_inertial_takes_the_quaternion_scalar_first() -> None:
    # A quarter turn about z takes body x to ECI y.
    law = InertialLaw(InertialOptions(q_eci_from_body=(2.0, 0.0, 0.0, 2.0)))
    R = law.attitude(surroundings(T_S))
    np.testing.assert_allclose(R[5] @ np.array([1.0, 0, 0]), [0, 1, 0], atol=1e-15)


def test_ned_is_the_thesis_equations() -> None:
    around = surroundings(T_S)
    R = NedLaw(NedOptions()).attitude(around)
    r = around.r_target_eci_m
    delta = np.arctan2(r[:, 1], r[:, 0])
    down = -unit(r)
    east = np.stack([-np.sin(delta), np.cos(delta), 0 * delta], axis=-1)
    np.testing.assert_allclose(R, np.stack([np.cross(east, down), east, down], axis=-1), atol=1e-12)


def test_ned_refuses_the_pole() -> None:
    over_pole = surroundings(np.array([0.0, np.pi / 2 / RATE_RAD_S]), inclination_rad=np.pi / 2)
    with pytest.raises(InputError, match=r"ned has no north at frame 1.*law nadir"):
        NedLaw(NedOptions()).attitude(over_pole)


@pytest.mark.parametrize("axis", AXES)
def test_tracking_holds_the_named_axis_on_the_chaser(axis: BodyAxis) -> None:
    around = surroundings(T_S)
    R = TrackingLaw(TrackingOptions(body_axis=axis)).attitude(around)
    pointing, following = body_axes(axis)
    chaser, _ = eci_from_rtn(
        around.r_target_eci_m, around.v_target_eci_m_s, around.r_chaser_rtn_m, np.zeros((len(T_S), 3))
    )
    np.testing.assert_allclose(R @ pointing, unit(chaser - around.r_target_eci_m), atol=1e-8)
    momentum = unit(np.cross(around.r_target_eci_m, around.v_target_eci_m_s))
    assert np.all(np.sum((R @ following) * momentum, axis=-1) > 0.9)


def test_tumbling_starts_from_the_given_attitude_and_rate() -> None:
    law = TumblingLaw(
        TumblingOptions(
            moments_kg_m2=(3, 4, 5), rate_body_deg_s=(6.0, 0, 0), q_eci_from_body=(1, 0, 0, 1)
        )
    )
    R = law.attitude(surroundings(np.array([0.0, 15.0])))
    # A quarter turn about z at the epoch; then 90° about body x, which stands at ECI y.
    np.testing.assert_allclose(R[0] @ np.array([1.0, 0, 0]), [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(R[1] @ np.array([0, 1.0, 0]), [0, 0, 1], atol=1e-14)


@given(inclination=st.sampled_from([0.0, 1e-10, np.pi / 2, np.pi - 1e-8, np.pi]), u=st.floats(0, 6.4))
def test_nadir_and_sun_pointing_know_no_pole(inclination: float, u: float) -> None:
    around = surroundings(np.array([u / RATE_RAD_S]), inclination_rad=inclination)
    for law in (NadirLaw(NoOptions()), SunPointingLaw(SunPointingOptions()), SpinLaw(SpinOptions())):
        assert np.linalg.det(law.attitude(around)) == pytest.approx(1.0, abs=1e-12)
