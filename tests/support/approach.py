"""A closed loop for tests of controllers: exact two-body truth, an estimate with errors, thrusters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from posse_core import (
    Constants,
    Controller,
    ControlProblem,
    Epoch,
    Estimate,
    PropagationProblem,
    Start,
    Target,
    ThrusterErrors,
    create,
)
from posse_core._dynamics.elements import state_from_keplerian
from posse_core._dynamics.linear import yamanaka_ankersen_stm

CONSTANTS = Constants()
NEAR_CIRCULAR = (7.1e6, 1e-4, 1.7, 0.1, 0.2, 0.3)
E_HALF = (14.2e6, 0.5, 1.7, 0.1, 0.2, 5.9)
"""Keplerian elements: a (m), e, i, Ω, ω, M (rad); the second is near its perigee, 722 km high."""
SMALL = np.diag(np.repeat([1e-6**2, 1e-9**2], 3))


def target(orbit: tuple[float, ...]) -> Target:
    return Target(*state_from_keplerian(np.array(orbit), CONSTANTS.mu_earth_m3_s2), CONSTANTS)


def problem(orbit: tuple[float, ...], end_s: float, step_s: float = 10.0) -> ControlProblem:
    """Without waypoints; an impulse is possible every ``step_s``."""
    burns_s = np.arange(0.0, end_s + step_s / 2, step_s)
    return ControlProblem(Epoch.from_iso("2022-01-31T02:02:27.58"), target(orbit), (), burns_s)


def estimate(rtn: np.ndarray, t_s: float, covariance: np.ndarray = SMALL) -> Estimate:
    return Estimate(t_s, rtn[:3].copy(), rtn[3:].copy(), covariance.copy())


def propagated(craft: Target, rtn: np.ndarray, after_s: np.ndarray) -> np.ndarray:
    """(6,), (K,) → (K, 6): exact relative motion, by the propagator ``roe``."""
    start = Start.from_rtn(craft, rtn[:3], rtn[3:])
    epoch = Epoch.from_iso("2022-01-31T02:02:27.58")
    motion = create("propagator", "roe").propagate(
        PropagationProblem(epoch=epoch, target=craft, starts=(start,), t_s=after_s)
    )
    return np.concatenate([motion.r_chaser_rtn_m, motion.v_chaser_rtn_m_s], axis=1)


def later(craft: Target, t_s: float) -> Target:
    """The target at an instant of its two-body orbit."""
    r, v = craft.two_body(np.array([t_s]))
    return Target(r[0], v[0], CONSTANTS, t_s=t_s)


@dataclass(frozen=True)
class Flown:
    """True states (B, 6) after the impulse at each instant, and the commands (B, 3).

    ``arcs`` (B, S, 6) are states on the way from each instant to the next.
    """

    states: np.ndarray
    dv: np.ndarray
    arcs: np.ndarray

    @property
    def total_m_s(self) -> float:
        return float(np.linalg.norm(self.dv, axis=1).sum())


class Known:
    """The estimate is the truth."""

    covariance = SMALL

    def __init__(self, craft: Target, rtn: np.ndarray) -> None:
        self.rtn = rtn

    def read(self, t_s: float, truth: np.ndarray) -> None:
        self.rtn = truth

    def burned(self, dv: np.ndarray) -> None:
        pass


def fly(
    controller: Controller,
    task: ControlProblem,
    rtn: np.ndarray,
    *,
    navigator: Callable[[Target, np.ndarray], Known] = Known,
    rng: np.random.Generator | None = None,
) -> Flown:
    """Fly from a state at the first instant to the last."""
    controller.start(task)
    knows = navigator(task.target, rtn)
    states, commands, arcs = [], [], []
    shares = np.linspace(0.1, 1.0, 10)
    for k, t_s in enumerate(task.burns_s):
        knows.read(float(t_s), rtn)
        dv = controller.command(estimate(knows.rtn, float(t_s), knows.covariance))
        knows.burned(dv)
        rtn = rtn + np.concatenate([np.zeros(3), executed(dv, task.thrusters, rng)])
        states.append(rtn)
        commands.append(dv)
        step_s = float(task.burns_s[k + 1] - t_s) if k + 1 < len(task.burns_s) else 10.0
        arcs.append(propagated(later(task.target, float(t_s)), rtn, shares * step_s))
        rtn = arcs[-1][-1]
    return Flown(np.array(states), np.array(commands), np.array(arcs))


def executed(dv: np.ndarray, errors: ThrusterErrors, rng: np.random.Generator | None) -> np.ndarray:
    """What thrusters make of a command."""
    size = float(np.linalg.norm(dv))
    if size == 0 or size < errors.least_m_s:
        return np.zeros(3)
    if rng is None:
        return dv
    across = rng.standard_normal(3)
    across -= dv * (dv @ across) / size**2
    return dv * (1 + errors.size * rng.standard_normal()) + size * errors.direction_rad * across


class Filter(Known):
    """A Kalman filter of noisy positions, so that errors and covariance belong together.

    It predicts by the exact motion, with the covariance of the linear motion about the target, and
    starts with errors of 0.1 m and 2 mm/s.
    """

    def __init__(
        self,
        craft: Target,
        rtn: np.ndarray,
        *,
        rng: np.random.Generator,
        errors: ThrusterErrors,
        sigma_m: float = 0.05,
    ) -> None:
        self.rng, self.errors, self.craft, self.sigma_m = rng, errors, craft, sigma_m
        self.covariance = np.diag(np.repeat([0.1**2, 0.002**2], 3))
        self.rtn = rtn + np.sqrt(np.diag(self.covariance)) * rng.standard_normal(6)
        self.t_s = 0.0

    def read(self, t_s: float, truth: np.ndarray) -> None:
        if t_s > self.t_s:
            chief, mu = later(self.craft, self.t_s), self.craft.mu_m3_s2
            phi = yamanaka_ankersen_stm(chief.qns, mu, t_s - self.t_s)
            self.rtn = propagated(chief, self.rtn, np.array([t_s - self.t_s]))[0]
            self.covariance = phi @ self.covariance @ phi.T
            self.t_s = t_s
        seen = truth[:3] + self.sigma_m * self.rng.standard_normal(3)
        S = self.covariance[:3, :3] + np.eye(3) * self.sigma_m**2
        gain = self.covariance[:, :3] @ np.linalg.inv(S)
        self.rtn = self.rtn + gain @ (seen - self.rtn[:3])
        left = np.eye(6)
        left[:, :3] -= gain
        self.covariance = left @ self.covariance @ left.T + gain @ gain.T * self.sigma_m**2

    def burned(self, dv: np.ndarray) -> None:
        size = float(np.linalg.norm(dv))
        self.rtn = self.rtn + np.concatenate([np.zeros(3), dv])
        if size > 0:
            along = np.outer(dv, dv) / size**2
            across = np.eye(3) - along
            spread = self.errors.size**2 * along + self.errors.direction_rad**2 * across
            self.covariance[3:, 3:] += size**2 * spread


class Drifting(Known):
    """Errors of 2 cm and 1 mm/s in each axis that vary slowly: 100 s of correlation."""

    covariance = np.diag(np.repeat([0.02**2, 0.001**2], 3))

    def __init__(self, craft: Target, rtn: np.ndarray, *, rng: np.random.Generator) -> None:
        self.rng, self.sigma = rng, np.sqrt(np.diag(self.covariance))
        self.error = self.sigma * rng.standard_normal(6)
        self.t_s = 0.0

    def read(self, t_s: float, truth: np.ndarray) -> None:
        kept = np.exp((self.t_s - t_s) / 100.0)
        fresh = self.sigma * self.rng.standard_normal(6)
        self.error = kept * self.error + np.sqrt(1 - kept**2) * fresh
        self.rtn, self.t_s = truth + self.error, t_s
