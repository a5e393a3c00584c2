"""The photoreceptor of an event camera's pixels: the logarithm of the light, and how fast it follows.

Below a floor the response is linear, as in v2e (Hu, Liu, Delbruck 2021), so that black space has a
finite value. Unlike there, the slope has no jump at the floor, and the response does not depend on the
unit of the light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray

_LEAST_BRIGHTNESS = 20 / 255
"""Brightness that is added in the bandwidth, so that it is not 0 in the dark: v2e's 20 of 255."""


@dataclass(frozen=True)
class Receptor:
    """The response of the photoreceptors.

    Attributes:
        floor_e_s: light below which the response is linear, electrons per second.
        white_e_s: light of brightness 1, electrons per second.
        bandwidth_hz: −3 dB frequency at brightness 1; None follows the light at once.
    """

    floor_e_s: float
    white_e_s: float
    bandwidth_hz: float | None

    def log(self, light_e_s: FloatArray) -> FloatArray:
        """ln(I / floor) above the floor, I / floor − 1 below it: (N,) → (N,)."""
        relative = light_e_s / self.floor_e_s
        return np.log(np.maximum(relative, 1.0)) + np.minimum(relative - 1.0, 0.0)

    def brightness(self, light_e_s: FloatArray) -> FloatArray:
        """Light relative to white, 0 … 1: v2e's luma."""
        return np.minimum(light_e_s / self.white_e_s, 1.0)

    def follow(
        self,
        level: FloatArray,
        log_before: FloatArray,
        log_after: FloatArray,
        mean_light_e_s: FloatArray,
        duration_s: float,
    ) -> FloatArray:
        """(N,) output of the photoreceptors after a step with a logarithm that is linear in time.

        It is the exact solution of the first-order low-pass τ dV/dt = L(t) − V with the time constant
        τ = 1 / (2π f), where f = bandwidth (Y + 20/255) / (1 + 20/255) at the brightness Y of the step's
        mean light (v2e).

        Args:
            level: (N,) output at the start of the step.
            log_before, log_after: (N,) logarithm of the light at its start and end.
            mean_light_e_s: (N,) light of the step, electrons per second.
            duration_s: length of the step, greater than 0.
        """
        if self.bandwidth_hz is None:
            return log_after
        share = (self.brightness(mean_light_e_s) + _LEAST_BRIGHTNESS) / (1 + _LEAST_BRIGHTNESS)
        tau_s = 1 / (2 * np.pi * self.bandwidth_hz * share)
        lag = (log_after - log_before) / duration_s * tau_s
        return log_after - lag + (level - log_before + lag) * np.exp(-duration_s / tau_s)
