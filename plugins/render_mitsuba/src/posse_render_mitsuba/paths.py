"""Light paths of compiled variants: each surface that a path meets asks the Sun, and the sky if the Sun
does not shine there.

Mitsuba's own path tracer asks one emitter a surface, chosen by chance: where Sun and sky give about as
much light, that choice alone is most of the noise. In sunlight the sky's own noise is small beside it,
and paths that leave the craft find the sky.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from posse_core import Camera, CraftState, R_with_z
from posse_render_mitsuba.world import near_plane_m

FAR_M = 1e4
"""How far a shadow ray to the Sun goes."""
FIRST_ROULETTE = 5
"""Segments of a path from which on it may end by chance, as in Mitsuba's own."""


@dataclass
class Sun:
    """A frame's Sun: even light from a disc at infinity, which no path meets by chance.

    Attributes:
        irradiance: on a plate that faces it, W/m² of three bands.
        R_body_from_sun: whose third column points to the middle of the disc.
        tangent: of the disc's angular radius.
    """

    irradiance: mi.Color3f
    R_body_from_sun: mi.Matrix3f
    tangent: mi.Float

    @classmethod
    def of(cls, craft: CraftState) -> Sun:
        """A frame's Sun as data: constants would be compiled into the kernel."""
        sun = cls(
            mi.Color3f(*map(float, craft.sun_irradiance_rgb_w_m2)),
            mi.Matrix3f(R_with_z(craft.sun_direction_body)),
            mi.Float(float(np.tan(craft.sun_angular_radius_rad))),
        )
        dr.make_opaque(sun)
        return sun

    def direction(self, sample: Any) -> Any:
        """Unit vector to a place on the disc, from a sample of the unit square."""
        place = mi.warp.square_to_uniform_disk_concentric(sample) * self.tangent
        return dr.normalize(self.R_body_from_sun @ mi.Vector3f(place.x, place.y, 1))


@dataclass
class Eye:
    """Where a frame's rays begin: in the plane at ``near`` before the camera, in body axes.

    Attributes:
        middle: where the optical axis meets the plane, m.
        R_body_from_cam: rotation.
        near: the plane's depth, m.
        pixel: its side at depth 1.
    """

    middle: mi.Point3f
    R_body_from_cam: mi.Matrix3f
    near: mi.Float
    pixel: mi.Float

    @classmethod
    def of(cls, craft: CraftState, camera: Camera, radius_m: float) -> Eye:
        """A frame's, as data. The plane is shortly before the craft, so that no digits are lost at
        large ranges."""
        R_body_from_cam = craft.R_cam_from_body.T
        near_m = near_plane_m(float(craft.t_body_cam_m[2]), radius_m)
        eye = cls(
            mi.Point3f(*map(float, R_body_from_cam @ ([0.0, 0.0, near_m] - craft.t_body_cam_m))),
            mi.Matrix3f(R_body_from_cam),
            mi.Float(near_m),
            mi.Float(1 / camera.fx_px),
        )
        dr.make_opaque(eye)
        return eye

    def ray(self, x: Any, y: Any, sample: Any) -> Any:
        """A ray through the pixel with its corner at ``x, y`` at depth 1, from a sample of the unit
        square."""
        across: Any = mi.Vector3f(x + sample.x * self.pixel, y + sample.y * self.pixel, 0)
        direction = dr.normalize(across + mi.Vector3f(0, 0, 1))
        return mi.Ray3f(
            self.middle + self.R_body_from_cam @ (across * self.near), self.R_body_from_cam @ direction
        )


def look(
    scene: Any, eye: Eye, sun: Sun, white: Any, max_depth: int, sampler: Any, x: Any, y: Any
) -> list[Any]:
    """One sample of each pixel whose corner is at ``x, y`` at depth 1.

    Returns:
        Radiance of three bands, coverage, 1, the bands' sum up to ``white``, and its square; all are 0
        where the radiance is not finite.
    """
    rgb, covered = trace(scene, sun, sampler, eye.ray(x, y, sampler.next_2d()), max_depth)
    light = dr.minimum(rgb.x + rgb.y + rgb.z, white)
    good = dr.isfinite(rgb.x) & dr.isfinite(rgb.y) & dr.isfinite(rgb.z)
    values = [rgb.x, rgb.y, rgb.z, dr.select(covered, mi.Float(1), mi.Float(0)), mi.Float(1)]
    values += [light, dr.square(light)]
    return [dr.select(good, value, mi.Float(0)) for value in values]


@dr.syntax
def trace(scene: Any, sun: Sun, sampler: Any, ray: Any, max_depth: int) -> tuple[Any, Any]:
    """Radiance along rays and whether they met the craft; the sky itself is not seen.

    Multiple importance sampling of sky and material: Veach, Robust Monte Carlo methods, 1997, chapter 9,
    with the power heuristic.

    Args:
        max_depth: longest path in segments; 2 is direct light alone.
    """
    sky = scene.environment()
    context = mi.BSDFContext()
    light, weight = mi.Color3f(0), mi.Color3f(1)
    depth, chance = mi.UInt32(0), mi.Float(0)
    before, active = dr.zeros(mi.Interaction3f), mi.Bool(True)
    met, asked = mi.Bool(False), mi.Bool(False)
    while active:
        hit = scene.ray_intersect(ray, mi.RayFlags.All, depth == 0, active)
        there = active & hit.is_valid()
        if dr.hint(sky is not None, mode="scalar"):
            away = active & ~hit.is_valid() & (depth > 0)
            found = mi.DirectionSample3f(scene, hit, before)
            share = _power(chance, sky.pdf_direction(before, found, away & asked))
            share = dr.select(asked, share, 1)  # of what the surface before has not got by asking
            light += dr.select(away, weight * share * sky.eval(hit, away), 0)
        met |= there & (depth == 0)
        goes_on = there & (depth + 1 < max_depth)
        bsdf = hit.bsdf(ray)
        # The Sun
        toward = sun.direction(sampler.next_2d(goes_on))
        local = hit.to_local(toward)
        sunlight = sun.irradiance * bsdf.eval(context, hit, local, goes_on)
        seen = goes_on & dr.any(sunlight != 0)
        seen &= ~scene.ray_test(hit.spawn_ray_to(hit.p + toward * FAR_M), seen)
        light += dr.select(seen, weight * sunlight, 0)
        # The sky
        if dr.hint(sky is not None, mode="scalar"):
            asked = goes_on & ~seen
            if asked:
                found, sky_light = sky.sample_direction(hit, sampler.next_2d())
                value, likely = bsdf.eval_pdf(context, hit, hit.to_local(found.d))
                clear = (found.pdf > 0) & dr.any(value != 0)
                clear &= ~scene.ray_test(hit.spawn_ray_to(found.p), clear)
                light += dr.select(clear, weight * value * sky_light * _power(found.pdf, likely), 0)
        # The next segment
        way, share_left = bsdf.sample(
            context, hit, sampler.next_1d(goes_on), sampler.next_2d(goes_on), goes_on
        )
        weight = dr.select(goes_on, weight * share_left, weight)
        chance = dr.select(goes_on, way.pdf, chance)
        before = mi.Interaction3f(hit)
        ray = hit.spawn_ray(hit.to_world(way.wo))
        depth += 1
        left = dr.max(weight)
        survives = dr.minimum(left, 0.95)
        drawn = sampler.next_1d(goes_on)
        roulette = depth >= FIRST_ROULETTE
        weight = dr.select(roulette & goes_on, weight / survives, weight)
        active = goes_on & (left > 0) & (~roulette | (drawn < survives))
    return light, met


def _power(one: Any, other: Any) -> Any:
    """Power heuristic with exponent 2: the share of ``one``."""
    square = dr.square(one)
    return dr.select(one > 0, square / (square + dr.square(other)), 0)
