"""The thermal model of one spacecraft: from its surroundings to temperatures and radiance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._geometry.tracer import Tracer
from posse_core._geometry.triangles import Triangles
from posse_core._model.bands import SUN_TEMPERATURE_K
from posse_core._model.spacecraft import Spacecraft
from posse_core._sensors.thermal.balance import Balance
from posse_core._sensors.thermal.facets import Facets
from posse_core._sensors.thermal.heating import Heat, Surroundings, heat_about, heat_at
from posse_core._sensors.thermal.planck import Band
from posse_core._sensors.thermal.surfaces import Surface

EARTH_K = 255.0
"""Temperature of the black body whose spectrum the Earth's infrared irradiance is given: that of the
Earth's mean radiation, 240 W/m² (CERES EBAF; Loeb et al. 2018, J. Climate 31, 895)."""
SQUARES = 1000
"""So many squares of the longest edge of a facet cover the surface, where that edge is not given."""


@dataclass(frozen=True)
class Temperatures:
    """Temperatures of N facets at one instant.

    Attributes:
        temperature_k: (N,) of the facets.
        heat: what reaches their sides then.
        change_k: by how much the last round of a periodic history changed one of them at most; 0 in
            equilibrium.
    """

    temperature_k: FloatArray
    heat: Heat
    change_k: float = 0.0


@dataclass(frozen=True, eq=False)
class ThermalModel:
    """A spacecraft's facets and their surfaces.

    Attributes:
        facets: the facets.
        surfaces: of each part.
        thin_m: walls up to this thickness have one temperature.
    """

    facets: Facets
    surfaces: Sequence[Surface]
    thin_m: float

    @classmethod
    def of(
        cls, craft: Spacecraft, surfaces: Sequence[Surface], *, facet_m: float | None, thin_m: float
    ) -> ThermalModel:
        """The model of a spacecraft; ``facet_m`` is the longest edge of a facet, None for a length whose
        square is a thousandth of the surface."""
        triangles = Triangles.of(craft)
        if facet_m is None:
            a, b, c = np.moveaxis(triangles.corners_m, 1, 0)
            surface_m2 = float(np.sum(np.linalg.norm(np.cross(b - a, c - a), axis=1))) / 2
            facet_m = math.sqrt(surface_m2 / SQUARES)
        return cls(Facets.of(Tracer(triangles), facet_m), surfaces, thin_m)

    def steady(self, around: Surroundings) -> Temperatures:
        """Temperatures at which every facet emits what it absorbs at an instant."""
        heat = heat_at(self.facets, around)
        return Temperatures(self.balance.steady_k(self.absorbed_w_m2(heat)), heat)

    def transient(self, past: Sequence[Surroundings]) -> Temperatures:
        """Temperatures at the last of several instants, ascending, whose history repeats itself.

        Revolutions that are shorter than the time from one instant to the next are averaged.
        """
        steps_s = np.diff([around.t_s for around in past])
        absorbed = np.empty((len(steps_s), self.facets.count))
        for number, around in enumerate(past):
            here = self.absorbed_w_m2(heat_about(self.facets, around, float(np.mean(steps_s)))) / 2
            if number > 0:
                absorbed[number - 1] += here
            if number < len(steps_s):
                absorbed[number] = here
        temperature_k, change_k = self.balance.periodic_k(steps_s, absorbed)
        return Temperatures(temperature_k, heat_at(self.facets, past[-1]), change_k)

    def absorbed_w_m2(self, heat: Heat) -> FloatArray:
        """(N,) heat that facets take up per area, through the sides that are not insulated."""
        sides = self._solar_absorptance * (heat.sun_w_m2 + heat.reflected_w_m2)
        sides += self._emissivity * heat.infrared_w_m2
        through = np.where(self._behind >= 0, sides[self._behind], 0.0)
        return np.asarray(sides[: self.facets.count] + through + self._of_facets("internal_power_w_m2"))

    def radiance_w_m2_sr(self, at: Temperatures, band: Band) -> FloatArray:
        """(2N,) radiance of each side in a band: emitted, and reflected into all directions evenly.

        Reflected are the infrared of the Earth with the spectrum of a black body of 255 K, sunlight,
        also that from the Earth, with that of the Sun, and the radiation of other facets with that of
        the wall (:class:`Balance`).
        """
        emitted = np.tile(band.radiance_w_m2_sr(at.temperature_k), 2)
        wall = band.radiance_w_m2_sr(np.array(self.balance.wall_k(at.temperature_k)))
        sun = at.heat.sun_w_m2 + at.heat.reflected_w_m2
        around = (
            band.share(EARTH_K) * at.heat.infrared_w_m2 + band.share(SUN_TEMPERATURE_K) * sun
        ) / np.pi + (1 - self.facets.openness) * wall
        return np.asarray(self._emissivity * emitted + (1 - self._emissivity) * around)

    @cached_property
    def balance(self) -> Balance:
        """The exchange of heat of the facets."""
        count, emissivity = self.facets.count, self._emissivity
        open_part = emissivity * self.facets.openness
        through = self._behind >= 0
        return Balance(
            emissivity=emissivity[:count] + np.where(through, emissivity[self._behind], 0.0),
            open=open_part[:count] + np.where(through, open_part[self._behind], 0.0),
            heat_capacity_j_m2_k=self._capacity,
            area_m2=self.facets.area_m2,
        )

    @cached_property
    def _behind(self) -> IntArray:
        return self.facets.behind(self.thin_m)

    @cached_property
    def _capacity(self) -> FloatArray:
        """(N,) heat capacity; a thin wall has that of both of its faces."""
        own, count = self._of_facets("heat_capacity_j_m2_k"), self.facets.count
        wall = (self._behind >= 0) & (self._behind < count)
        return own + np.where(wall, own[self._behind % count], 0.0)

    @cached_property
    def _emissivity(self) -> FloatArray:
        """(2N,) of the sides."""
        return np.tile(self._of_facets("emissivity"), 2)

    @cached_property
    def _solar_absorptance(self) -> FloatArray:
        """(2N,) of the sides."""
        return np.tile(self._of_facets("solar_absorptance"), 2)

    def _of_facets(self, name: str) -> FloatArray:
        """(N,) a property of the parts' surfaces."""
        by_part = np.array([getattr(surface, name) for surface in self.surfaces], dtype=np.float64)
        return by_part[self.facets.part_id]
