"""Temperatures of facets from the heat that they absorb and emit.

Each facet has one temperature through its thickness. Heat does not flow along the surface from facet to
facet: conduction is neglected. A facet emits ε σ T⁴ from each of its sides that is not insulated. The
share of a side's hemisphere in which other facets are exchanges heat with one common wall, whose
temperature is
such that it takes as much heat as it gives: a node of radiosity that stands for all facets that see each
other (the enclosure of Modest, Radiative Heat Transfer, 3rd ed. 2013, chapter 5, with one black node in
place of the exchange factors of every pair). So heat is neither made nor lost between the facets.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._sensors.thermal.planck import SPACE_K
from posse_core._sensors.thermal.planck import STEFAN_BOLTZMANN_W_M2_K4 as SIGMA

CLOSED_K = 0.02
"""A periodic start is found when no temperature changes by more from one round to the next."""
MOST_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Balance:
    """What the exchange of heat of N facets depends on; all of its arrays are (N,).

    Attributes:
        emissivity: ε, summed over the sides that are not insulated; above 0.
        open: the part of that sum that faces the sky, and not other facets.
        heat_capacity_j_m2_k: heat capacity per area of the facet.
        area_m2: areas.
    """

    emissivity: FloatArray
    open: FloatArray
    heat_capacity_j_m2_k: FloatArray
    area_m2: FloatArray

    def steady_k(self, absorbed_w_m2: FloatArray) -> FloatArray:
        """(N,) temperatures at which every facet emits what it absorbs, (N,) per area of the facet.

        σ (E T⁴ − (E − e) W⁴ − e T₀⁴) = q with the emissivity E, its open part e, the wall's temperature
        W and space's T₀. The wall's fourth power follows in closed form from Σ A (E − e) (T⁴ − W⁴) = 0.
        """
        own = absorbed_w_m2 / SIGMA + self.open * SPACE_K**4
        hidden = self._hidden
        given = np.sum(hidden * own / self.emissivity)
        taken = np.sum(hidden * self.open / self.emissivity)
        wall4 = given / taken if taken > 0 else SPACE_K**4
        return _fourth_root((own + (self.emissivity - self.open) * wall4) / self.emissivity)

    def periodic_k(self, steps_s: FloatArray, absorbed_w_m2: FloatArray) -> tuple[FloatArray, float]:
        """Temperatures at the end of a history that repeats itself without end.

        Args:
            steps_s: (K,) lengths of its steps.
            absorbed_w_m2: (K, N) mean heat that the facets absorb in each step.

        Returns:
            (N,) temperatures, and by how much the last round changed one of them at most, K: a larger
            number than :data:`CLOSED_K` says that :data:`MOST_ROUNDS` rounds were not enough.
        """
        mean_w_m2 = np.einsum("k,kn->n", steps_s, absorbed_w_m2) / np.sum(steps_s)
        temperature_k = self.steady_k(mean_w_m2)
        change_k, last_k = np.zeros_like(temperature_k), np.inf
        for number in range(1, MOST_ROUNDS + 1):
            before_k, change_before_k = temperature_k, change_k
            for step_s, absorbed in zip(steps_s, absorbed_w_m2, strict=True):
                temperature_k = self.after_k(temperature_k, absorbed, step_s)
            change_k = temperature_k - before_k
            last_k = float(np.max(np.abs(change_k)))
            if last_k <= CLOSED_K:
                break
            if number % 3 == 0:  # the remaining changes are a geometric series (Aitken 1926)
                with np.errstate(divide="ignore", invalid="ignore"):
                    ratio = np.clip(np.nan_to_num(change_k / change_before_k), 0, 0.9)
                temperature_k = temperature_k + change_k * ratio / (1 - ratio)
        return temperature_k, last_k

    def after_k(self, temperature_k: FloatArray, absorbed_w_m2: FloatArray, step_s: float) -> FloatArray:
        """(N,) temperatures a step later, under the step's mean absorbed heat (N,).

        With the temperature Tₑ at which a facet would be in equilibrium,
        C dT/dt = σE (Tₑ⁴ − T⁴) = k (Tₑ − T), k = σE (Tₑ + T)(Tₑ² + T²). With k of the middle of the step
        the linear equation is solved exactly. So the step is of second order, and T never passes Tₑ: no
        step is too long for it to be stable.
        """
        rest_k = self._rest_k(temperature_k, absorbed_w_m2)
        middle_k = self._towards_k(rest_k, temperature_k, temperature_k, step_s / 2)
        rest_k = self._rest_k(middle_k, absorbed_w_m2)
        return self._towards_k(rest_k, temperature_k, middle_k, step_s)

    def wall_k(self, temperature_k: FloatArray) -> float:
        """Temperature of the common wall beside facets of temperatures (N,)."""
        hidden = self._hidden
        total = np.sum(hidden)
        square = temperature_k * temperature_k
        return float((np.sum(hidden * square * square) / total) ** 0.25) if total > 0 else SPACE_K

    def _rest_k(self, temperature_k: FloatArray, absorbed_w_m2: FloatArray) -> FloatArray:
        """(N,) the temperatures at which facets would rest while the wall keeps its temperature."""
        walls = (self.emissivity - self.open) * self.wall_k(temperature_k) ** 4
        into = absorbed_w_m2 / SIGMA + self.open * SPACE_K**4 + walls
        return _fourth_root(into / self.emissivity)

    def _towards_k(
        self, rest_k: FloatArray, from_k: FloatArray, at_k: FloatArray, step_s: float
    ) -> FloatArray:
        rate_w_m2_k = SIGMA * self.emissivity * (rest_k + at_k) * (rest_k * rest_k + at_k * at_k)
        return np.asarray(
            rest_k + (from_k - rest_k) * np.exp(-rate_w_m2_k * step_s / self.heat_capacity_j_m2_k)
        )

    @cached_property
    def _hidden(self) -> FloatArray:
        """(N,) areas times the emissivity towards other facets."""
        return np.asarray(self.area_m2 * (self.emissivity - self.open))


def _fourth_root(x: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.sqrt(x)))  # several times faster than a power
