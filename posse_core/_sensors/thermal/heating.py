"""Heat that reaches the sides of facets: from the Sun, and from the Earth by reflection and
radiation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._environment.earthlight import earth_patches
from posse_core._frames import turned
from posse_core._geometry.triangles import dot
from posse_core._model.scene import FrameState
from posse_core._sensors.thermal.facets import Facets

_SPIN_STEP_RAD = np.radians(10.0)
"""Largest turn between the attitudes over which the heat of a turning spacecraft is averaged."""
_EARTH_ATTITUDES = 8
"""Most attitudes at which the Earth's heat is averaged: it varies smoothly with a facet's tilt."""
_SUN_JUMP = 0.25
"""Change of the Sun's visible share from one instant to the next above which instants are added."""
_CLOSEST_S = 2.0
"""No instant is added nearer to another."""
_NORMALS = 1 << 13
"""Tilts of facets that are computed at once, to save memory."""
_EARTH_RADIUS_M = Constants().earth_radius_m


@dataclass(frozen=True)
class Surroundings:
    """What shines on the spacecraft at one instant, in body axes.

    Attributes:
        t_s: the instant, seconds since the scenario's epoch.
        sun_direction: (3,) unit vector to the Sun.
        sun_w_m2: irradiance by the visible part of the Sun's disc.
        sun_share: that part, 0 … 1.
        earth_directions: (3, K) unit vectors to patches of the Earth.
        earth_reflected_w_m2, earth_emitted_w_m2: (K,) irradiance by each patch on a plate that faces it:
            sunlight that it reflects, and its infrared radiation.
        omega_rad_s: (3,) angular velocity of the body.
    """

    t_s: float
    sun_direction: FloatArray
    sun_w_m2: float
    sun_share: float
    earth_directions: FloatArray
    earth_reflected_w_m2: FloatArray
    earth_emitted_w_m2: FloatArray
    omega_rad_s: FloatArray

    @classmethod
    def of(cls, state: FrameState) -> Surroundings:
        """The surroundings of the target in a state. The Earth is a sphere here."""
        R_body_from_eci = state.craft.R_cam_from_body.T @ state.R_cam_from_eci
        patches = earth_patches(
            r_eci_m=state.r_target_eci_m[None],
            r_sun_eci_m=state.r_sun_eci_m[None],
            earth_pole_eci=state.R_ecef_from_eci[None, 2],
            jd_tt=np.array([state.epoch_jd_tt]),
            solar_flux_w_m2=np.array([state.solar_flux_w_m2]),
            earth_radius_m=_EARTH_RADIUS_M,
        )
        return cls(
            t_s=state.t_s,
            sun_direction=state.craft.sun_direction_body,
            sun_w_m2=state.solar_flux_w_m2 * state.sun_fraction_target,
            sun_share=state.sun_fraction_target,
            earth_directions=np.stack([dot(row, patches.directions[0].T) for row in R_body_from_eci]),
            earth_reflected_w_m2=(patches.reflected_w_m2_sr * patches.solid_angle_sr)[0],
            earth_emitted_w_m2=(patches.emitted_w_m2_sr * patches.solid_angle_sr)[0],
            omega_rad_s=state.craft.rates.omega_body_rad_s,
        )

    def after_turning(self, after_s: float) -> Surroundings:
        """The same surroundings for the body as its rate turns it, all else at rest."""
        earth = turned(self.earth_directions.T, -self.omega_rad_s, np.asarray(after_s)).T
        return replace(
            self,
            sun_direction=turned(self.sun_direction, -self.omega_rad_s, np.asarray(after_s)),
            earth_directions=np.ascontiguousarray(earth),
        )


@dataclass(frozen=True)
class Heat:
    """Irradiance (2N,) of each side of N facets, W/m²; sides are those of :class:`Facets`.

    Attributes:
        sun_w_m2: direct sunlight, with shadows.
        reflected_w_m2: sunlight from the Earth.
        infrared_w_m2: the Earth's own radiation.
    """

    sun_w_m2: FloatArray
    reflected_w_m2: FloatArray
    infrared_w_m2: FloatArray


def sunlight(facets: Facets, around: Surroundings, lit: FloatArray) -> FloatArray:
    """(2N,) irradiance by the Sun on each side, of which a share ``lit`` (2N,) is not in shadow."""
    cosine = dot(facets.normal, around.sun_direction)
    return np.asarray(lit * around.sun_w_m2 * np.maximum(np.concatenate([cosine, -cosine]), 0.0))


def earthlight(facets: Facets, around: Surroundings) -> tuple[FloatArray, FloatArray]:
    """(2N,) irradiance of each side by the Earth: reflected sunlight, and infrared radiation.

    Other facets hide the share of it that they hide of the side's whole hemisphere.
    """
    normals, which = facets.normals
    # In single precision this is twice as fast, and right to 1e-5.
    towards, tilts = around.earth_directions.astype(np.float32), normals.astype(np.float32)
    patches_w_m2 = np.stack([around.earth_reflected_w_m2, around.earth_emitted_w_m2])
    front = np.empty((2, normals.shape[1]))
    for start in range(0, normals.shape[1], _NORMALS):
        part = slice(start, start + _NORMALS)
        facing = towards[0][:, None] * tilts[0, part]
        for direction, along in zip(towards[1:], tilts[1:, part], strict=True):
            facing += direction[:, None] * along
        np.maximum(facing, 0, out=facing)
        front[:, part] = np.einsum("pk,kn->pn", patches_w_m2.astype(np.float32), facing)
    # Behind, max(−c, 0) = max(c, 0) − c.
    whole = np.einsum("pk,ik->pi", patches_w_m2, around.earth_directions)
    back = np.maximum(front - np.einsum("pi,in->pn", whole, normals), 0.0)
    received = facets.openness * np.concatenate([front[:, which], back[:, which]], axis=1)
    return received[0], received[1]


def heat_at(facets: Facets, around: Surroundings) -> Heat:
    """The heat at an instant, with the shadows of the Sun's very direction."""
    lit = facets.lit(around.sun_direction)
    return Heat(sunlight(facets, around, lit), *earthlight(facets, around))


def heat_about(facets: Facets, around: Surroundings, span_s: float) -> Heat:
    """The mean heat while the body turns at its rate, over a span about the instant, or over one
    revolution, if that is shorter."""
    turn_rad = min(float(np.linalg.norm(around.omega_rad_s)) * span_s, 2 * np.pi)
    rate_rad_s = float(np.linalg.norm(around.omega_rad_s))

    def attitudes(most: float) -> Iterator[Surroundings]:
        count = int(min(np.ceil(turn_rad / _SPIN_STEP_RAD), most)) or 1
        if count == 1:
            yield around
            return
        for share in (np.arange(count) + 0.5) / count - 0.5:
            yield around.after_turning(float(share * turn_rad / rate_rad_s))

    suns = [sunlight(facets, a, facets.lit_about(a.sun_direction)) for a in attitudes(np.inf)]
    earths = [earthlight(facets, a) for a in attitudes(_EARTH_ATTITUDES)]
    reflected, infrared = (np.mean(part, axis=0) for part in zip(*earths, strict=True))
    return Heat(np.mean(suns, axis=0), reflected, infrared)


def history(at: Callable[[float], Surroundings], lead_s: float, steps: int) -> list[Surroundings]:
    """Surroundings at instants from ``lead_s`` before now until now, ascending.

    Args:
        at: surroundings so many seconds after now.
        lead_s: length of the history.
        steps: into which it is divided evenly; where the Sun rises or sets between two instants, further
            ones are added until they are 2 s apart.
    """
    known = {float(after_s): at(float(after_s)) for after_s in np.linspace(-lead_s, 0.0, steps + 1)}
    pending = [*zip(sorted(known), sorted(known)[1:], strict=False)]
    while pending:
        low_s, high_s = pending.pop()
        jump = abs(known[high_s].sun_share - known[low_s].sun_share)
        if jump > _SUN_JUMP and high_s - low_s > 2 * _CLOSEST_S:
            middle_s = (low_s + high_s) / 2
            known[middle_s] = at(middle_s)
            pending += [(low_s, middle_s), (middle_s, high_s)]
    return [known[after_s] for after_s in sorted(known)]
