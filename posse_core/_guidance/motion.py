"""Relative motion as controllers predict it: exact without impulses, linear in the impulses."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._dynamics import elements, roe
from posse_core._dynamics.linear import yamanaka_ankersen_stm
from posse_core._dynamics.start import Target
from posse_core._frames import R_eci_from_rtn, by_plane_turn, rtn_spin_rad_s


class RelativeMotion:
    """The motion beside a target on its two-body orbit, any e < 1, from one instant on.

    Args:
        target: the target's orbit.
        t_s: the instant, on the same clock as ``target.t_s``.

    Raises:
        posse_core.InputError: the target's orbit is not elliptic.
    """

    def __init__(self, target: Target, t_s: float) -> None:
        self._target, self.t_s = target, t_s
        self._since_s = t_s - target.t_s

    def transition(self, t_s: FloatArray) -> FloatArray:
        """(K,) → (K, 6, 6): RTN state at ``t_s`` from that at the instant, linear in the separation.

        Yamanaka and Ankersen (2002), about the target's orbit.
        """
        chief = elements.later(self._target.qns, self._target.mu_m3_s2, np.array(self._since_s))
        return yamanaka_ankersen_stm(chief, self._target.mu_m3_s2, t_s - self.t_s)

    def drift(self, rtn: FloatArray, t_s: FloatArray) -> FloatArray:
        """(6,) RTN state at the instant, (K,) → (K, 6): RTN states without impulses, exact for two
        bodies."""
        target = self._target
        r, v = (part[0] for part in target.two_body(np.array([self._since_s])))
        R = R_eci_from_rtn(r, v)
        turning = np.cross(rtn_spin_rad_s(r, v, target.plane_turn_rad_s(r, v)), rtn[:3])
        chief = elements.later(target.equinoctial, target.mu_m3_s2, np.array(self._since_s))
        relative = roe.equinoctial_roe_from_states(
            r, v, R @ rtn[:3], R @ (rtn[3:] + turning), target.sign, target.mu_m3_s2
        )
        states = roe.rtn_from_equinoctial_roe(
            chief, target.sign, relative, target.mu_m3_s2, t_s - self.t_s
        )
        if target.turns_plane:
            turn = target.plane_turn_rad_s(*target.two_body(t_s - target.t_s))
            states[:, 3:] -= by_plane_turn(turn, states[:, :3])
        return states
