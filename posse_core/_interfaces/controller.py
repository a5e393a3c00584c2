"""Controllers: from the estimate of the relative state to the next impulse."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics.plan import Burn
from posse_core._dynamics.start import Target
from posse_core._environment.time import Epoch
from posse_core._interfaces.navigator import Estimate, ThrusterErrors
from posse_core._plugins.component import Component, OptionsT


@dataclass(frozen=True)
class Waypoint:
    """A relative state to reach, and to hold for a while. RTN: the target's axes.

    Attributes:
        t_s: when it is to be reached, seconds since the scenario's epoch.
        until_s: it is held from ``t_s`` until then; equal to ``t_s`` for a state to pass through.
        r_rtn_m: (3,) position.
        v_rtn_m_s: (3,) velocity in the rotating axes.
    """

    t_s: float
    until_s: float
    r_rtn_m: FloatArray
    v_rtn_m_s: FloatArray


@dataclass(frozen=True)
class Cone:
    """An approach cone: the chaser stays within it once it is nearer than its length.

    Attributes:
        axis_rtn: (3,) unit vector from the target along the axis, RTN axes.
        half_angle_rad: between axis and surface.
        length_m: how far the cone reaches from the target.
    """

    axis_rtn: FloatArray
    half_angle_rad: float
    length_m: float


@dataclass(frozen=True)
class Safety:
    """Where the chaser may fly.

    Attributes:
        keep_out_m: (3,) semi-axes along R, T, N of an ellipsoid about the target that the chaser does
            not enter, or None.
        cone: that it stays in when near, or None.
        passive_s: for how long after each impulse the chaser stays out of the ellipsoid if no other
            follows; 0 asks for nothing.
    """

    keep_out_m: FloatArray | None = None
    cone: Cone | None = None
    passive_s: float = 0.0


_EXACT, _FREE = ThrusterErrors(), Safety()


@dataclass(frozen=True)
class ControlProblem:
    """What a controller is to achieve.

    Attributes:
        epoch: the instant of t_s = 0.
        target: the target's orbit at the epoch.
        waypoints: in order of time; at least one, except for a controller that needs none.
        plan: impulses that were planned beforehand, in order of time.
        burns_s: (B,) the instants at which an impulse is possible, in order.
        largest_m_s: limit of the size of an impulse; infinite if there is none.
        safety: where the chaser may fly.
        thrusters: errors of the impulses.
    """

    epoch: Epoch
    target: Target
    waypoints: tuple[Waypoint, ...]
    burns_s: FloatArray
    plan: tuple[Burn, ...] = ()
    largest_m_s: float = np.inf
    safety: Safety = _FREE
    thrusters: ThrusterErrors = _EXACT


class Controller(Component[OptionsT]):
    """Decides on the chaser's impulses.

    :meth:`start` is called once; then :meth:`command` at each of the instants ``burns_s`` at which the
    navigator has an estimate, in order.
    """

    @abstractmethod
    def start(self, problem: ControlProblem) -> None:
        """Begin a flight.

        Raises:
            posse_core.InputError: the goal is not one that this controller can have.
        """

    @abstractmethod
    def command(self, estimate: Estimate) -> FloatArray:
        """The impulse (3,) m/s, RTN axes, at ``estimate.t_s``; zeros for none."""
