"""Closed-form tumbling against Euler's equations integrated step by step, and its invariants."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from posse_core._arrays import FloatArray
from posse_core._attitude.options import TumblingOptions
from posse_core._attitude.tumbling import torque_free_attitude

T_S = np.linspace(0.0, 60.0, 31)
AXES = Rotation.from_quat([0.3, -0.5, 0.2, 0.8]).as_matrix()
START = Rotation.from_quat([-0.1, 0.4, 0.7, 0.2]).as_matrix()


def inertia_of(moments: tuple[float, float, float]) -> FloatArray:
    return AXES @ np.diag(moments) @ AXES.T


def integrated_attitude(inertia: FloatArray, rate: FloatArray, start: FloatArray) -> FloatArray:
    """Euler's equations and the kinematics of the matrix itself, by Dormand–Prince of order 8."""

    def slope(_: float, y: FloatArray) -> FloatArray:
        R, w = y[:9].reshape(3, 3), y[9:]
        turning = np.linalg.solve(inertia, np.cross(inertia @ w, w))
        # The columns of R turn with the body: Ṙ = R [w]×.
        return np.concatenate([(R @ np.cross(np.eye(3), w)).ravel(), turning])

    y0 = np.concatenate([start.ravel(), rate])
    solution = solve_ivp(slope, (0, T_S[-1]), y0, "DOP853", T_S, rtol=1e-12, atol=1e-13)
    return solution.y[:9].T.reshape(-1, 3, 3)


@pytest.mark.parametrize(
    ("moments", "rate_in_principal_axes"),
    [
        ((1.0, 1.7, 2.5), (0.1, 0.2, 0.3)),  # circles the largest
        ((1.0, 1.7, 2.5), (-0.3, 0.2, 0.05)),  # circles the smallest
        ((2.5, 1.0, 1.7), (0.2, -0.3, -0.2)),  # in another order
        ((2.0, 2.0, 3.0), (0.2, 0.1, 0.2)),  # a disc
        ((3.0, 1.2, 3.0), (0.1, 0.3, 0.2)),  # a rod
        ((1.0, 2.0, 3.0), (0.2, 0.1, 0.3)),  # a plate
        ((1.0, 1.7, 2.5), (1e-3, 0.3, 0.0)),  # turns over its middle axis
        ((2.0, 2.0, 2.0), (0.1, 0.2, 0.3)),  # a ball
        ((1.0, 1.7, 2.5), (0.0, 0.0, -0.4)),  # steady
        ((1.0, 1.7, 2.5), (0.0, 0.0, 0.0)),  # still
    ],
)
def test_against_integrated_equations(
    moments: tuple[float, float, float], rate_in_principal_axes: tuple[float, float, float]
) -> None:
    inertia, rate = inertia_of(moments), AXES @ rate_in_principal_axes
    ours = torque_free_attitude(inertia, rate, START, T_S)
    np.testing.assert_allclose(ours, integrated_attitude(inertia, rate, START), atol=1e-9)


def test_a_disc_precesses_at_the_published_rate() -> None:
    # Goldstein, Classical Mechanics, 5.6: the axis circles the momentum at |L| / transverse moment.
    inertia, rate = np.diag([2.0, 2.0, 3.0]), np.array([0.2, 0.0, 0.5])
    momentum = inertia @ rate
    period_s = 2 * np.pi * 2.0 / np.linalg.norm(momentum)
    axis = torque_free_attitude(inertia, rate, np.eye(3), np.array([0.0, period_s / 2, period_s]))[
        ..., 2
    ]
    np.testing.assert_allclose(axis[2], axis[0], atol=1e-13)
    along = momentum / np.linalg.norm(momentum)
    np.testing.assert_allclose(axis[1], 2 * (axis[0] @ along) * along - axis[0], atol=1e-13)


moment = st.floats(0.5, 50.0)
rates = st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array)


@given(a=moment, b=moment, share=st.floats(0.01, 0.99), rate=rates, t_s=st.floats(-1e4, 1e4))
def test_momentum_and_energy_are_conserved(
    a: float, b: float, share: float, rate: FloatArray, t_s: float
) -> None:
    # A third moment between |a − b| and a + b, so that a body can have all three.
    inertia = inertia_of((a, b, abs(a - b) + share * (a + b - abs(a - b))))
    step = 1e-3
    R = torque_free_attitude(inertia, rate, START, t_s + np.array([-step, 0.0, step]))
    np.testing.assert_allclose(
        R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12
    )
    # The rate there, from the attitude alone: an error of order (rate·step)².
    turn = Rotation.from_matrix(R[0].T @ R[2]).as_rotvec() / (2 * step)
    momentum_ref = START @ inertia @ rate
    scale = np.linalg.norm(momentum_ref) + 1e-12
    assert np.linalg.norm(R[1] @ inertia @ turn - momentum_ref) < 1e-5 * scale
    energy = rate @ inertia @ rate
    assert abs(turn @ inertia @ turn - energy) < 2e-5 * energy + 1e-12


@given(rate=rates, t_s=st.floats(0, 5e3))
def test_momentum_stands_still_and_energy_holds_to_1e_8(rate: FloatArray, t_s: float) -> None:
    """The rate at the end of a first stretch follows from the two invariants' axes; go on from it."""
    inertia = inertia_of((1.0, 1.7, 2.5))
    whole = torque_free_attitude(inertia, rate, START, np.array([t_s]))[0]
    # L is fixed in the reference axes, so the body's rate there is I⁻¹ Rᵀ L.
    momentum_ref = START @ inertia @ rate
    rate_there = np.linalg.solve(inertia, whole.T @ momentum_ref)
    energy, energy_there = rate @ inertia @ rate, rate_there @ inertia @ rate_there
    assert abs(energy_there - energy) <= 1e-8 * energy
    back = torque_free_attitude(inertia, rate_there, whole, np.array([-t_s]))[0]
    np.testing.assert_allclose(whole.T @ whole, np.eye(3), atol=1e-12)
    separation = abs(np.linalg.norm(inertia @ rate) ** 2 - 1.7 * energy)
    if separation > 0.05 * energy:  # near the middle axis the way back is unstable
        np.testing.assert_allclose(back, START, atol=1e-8)


@pytest.mark.parametrize("moments", [(1.0, 1.0, 2.1), (0.0, 1.0, 1.0), (-1.0, 1.0, 1.0)])
def test_moments_that_no_body_has_are_refused(moments: tuple[float, float, float]) -> None:
    with pytest.raises(ValidationError, match="no body has the principal moments"):
        TumblingOptions(moments_kg_m2=moments, rate_body_deg_s=(1, 0, 0))


def test_products_of_inertia_count() -> None:
    with pytest.raises(ValidationError, match="no body has"):
        TumblingOptions(moments_kg_m2=(1, 1, 1), products_kg_m2=(0.9, 0, 0), rate_body_deg_s=(1, 0, 0))
