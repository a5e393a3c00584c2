"""The path tracer of the compiled variants. At each surface that a path hits, it samples the Sun, and
the sky too if the Sun does not shine there.

Mitsuba's own path tracer samples one randomly chosen emitter per surface. Where Sun and sky give similar
light, that choice causes most of the noise. In sunlight the sky need not be sampled: paths that leave
the spacecraft reach it, and the noise they leave is small beside the Sun's light.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from posse_core import Camera, CraftState, R_with_z
from posse_render_mitsuba.materials import Table
from posse_render_mitsuba.strata import Strata
from posse_render_mitsuba.world import Place

FAR_M = 1e4
"""Length of a shadow ray to the Sun."""
ROULETTE_DEPTH = 5
"""Number of segments after which Russian roulette may end a path, as in Mitsuba's own path tracer."""


@dataclass
class Sun:
    """The Sun of one frame: a uniform disc at infinity. Scattered paths never hit it; it is only
    sampled.

    Attributes:
        irradiance: on a plate that faces the Sun, W/m² in three bands.
        R_world_from_sun: rotation whose third column points to the centre of the disc.
        tangent: tangent of the disc's angular radius.
    """

    irradiance: mi.Color3f
    R_world_from_sun: mi.Matrix3f
    tangent: mi.Float

    @classmethod
    def of(cls, craft: CraftState) -> Sun:
        """The Sun of a frame as opaque values; Dr.Jit would compile constants into the kernel."""
        sun = cls(
            mi.Color3f(*map(float, craft.sun_irradiance_rgb_w_m2)),
            mi.Matrix3f(R_with_z(craft.sun_direction_body)),
            mi.Float(float(np.tan(craft.sun_angular_radius_rad))),
        )
        dr.make_opaque(sun)
        return sun

    def direction(self, sample: Any) -> Any:
        """Unit vector, world axes, to a random point of the disc; ``sample`` is in the unit square."""
        point = mi.warp.square_to_uniform_disk_concentric(sample) * self.tangent
        return dr.normalize(self.R_world_from_sun @ mi.Vector3f(point.x, point.y, 1))


@dataclass
class CameraRays:
    """The camera rays of one frame, world axes. They start in the plane at the planar depth ``near``.

    Attributes:
        centre: where the optical axis crosses the plane, m.
        R_world_from_cam: rotation from camera to world axes.
        near: planar depth of the plane, m.
        pixel: side of a pixel at depth 1.
    """

    centre: mi.Point3f
    R_world_from_cam: mi.Matrix3f
    near: mi.Float
    pixel: mi.Float

    @classmethod
    def of(cls, place: Place, camera: Camera) -> CameraRays:
        """The camera rays of a frame, as opaque values. The plane is just in front of all links, so that
        single precision suffices at large ranges."""
        R_world_from_cam = place.poses.R_cam_from_world.T
        centre_m = R_world_from_cam @ ([0.0, 0.0, place.near_m] - place.poses.t_world_cam_m)
        rays = cls(
            mi.Point3f(*map(float, centre_m)),
            mi.Matrix3f(R_world_from_cam),
            mi.Float(place.near_m),
            mi.Float(1 / camera.fx_px),
        )
        dr.make_opaque(rays)
        return rays

    def ray(self, x: Any, y: Any, sample: Any) -> Any:
        """A ray through a random point of the pixel whose corner is at ``x, y`` at depth 1; ``sample``
        is in the unit square."""
        across: Any = mi.Vector3f(x + sample.x * self.pixel, y + sample.y * self.pixel, 0)
        direction = dr.normalize(across + mi.Vector3f(0, 0, 1))
        return mi.Ray3f(
            self.centre + self.R_world_from_cam @ (across * self.near), self.R_world_from_cam @ direction
        )


def sample_pixels(
    scene: Any,
    materials: Table,
    rays: CameraRays,
    sun: Sun,
    brightest: Any,
    max_depth: int,
    strata: Strata,
    x: Any,
    y: Any,
) -> list[Any]:
    """Take one sample of each pixel whose corner is at ``x, y`` at depth 1.

    Returns:
        Per sample: radiance in three bands, coverage, 1, the sum of the bands clipped at
        ``brightest``, and the square of that sum. All are 0 where the radiance is not finite.
    """
    ray = rays.ray(x, y, strata.numbers(0).light)
    rgb, covered = trace(scene, materials, sun, strata, ray, max_depth)
    clipped = dr.minimum(rgb.x + rgb.y + rgb.z, brightest)
    finite = dr.isfinite(rgb.x) & dr.isfinite(rgb.y) & dr.isfinite(rgb.z)
    values = [rgb.x, rgb.y, rgb.z, dr.select(covered, mi.Float(1), mi.Float(0)), mi.Float(1)]
    values += [clipped, dr.square(clipped)]
    return [dr.select(finite, value, mi.Float(0)) for value in values]


@dr.syntax
def trace(
    scene: Any, materials: Table, sun: Sun, strata: Strata, ray: Any, max_depth: int
) -> tuple[Any, Any]:
    """Radiance along camera rays, and whether they hit the spacecraft. The sky lights the spacecraft but
    is not itself seen.

    Multiple importance sampling of sky and material, with the power heuristic: Veach, Robust Monte Carlo
    methods, 1997, chapter 9.

    Args:
        max_depth: longest path in segments; 2 gives direct light alone.
    """
    sky = scene.environment()
    radiance, throughput = mi.Color3f(0), mi.Color3f(1)
    depth, scatter_pdf = mi.UInt32(0), mi.Float(0)
    previous, active = dr.zeros(mi.Interaction3f), mi.Bool(True)
    covered, sky_sampled = mi.Bool(False), mi.Bool(False)
    while active:
        hit = scene.ray_intersect(ray, mi.RayFlags.All, depth == 0, active)
        on_craft = active & hit.is_valid()
        if dr.hint(sky is not None, mode="scalar"):
            escaped = active & ~hit.is_valid() & (depth > 0)
            to_sky = mi.DirectionSample3f(scene, hit, previous)
            share = _power(scatter_pdf, sky.pdf_direction(previous, to_sky, escaped & sky_sampled))
            share = dr.select(sky_sampled, share, 1)  # 1 if the previous surface did not sample the sky
            radiance += dr.select(escaped, throughput * share * sky.eval(hit, escaped), 0)
        covered |= on_craft & (depth == 0)
        goes_on = on_craft & (depth + 1 < max_depth)
        surface = materials.surface(hit, goes_on)
        numbers = strata.numbers(depth + 1)
        # The Sun
        to_sun = sun.direction(numbers.light)
        sunlight = sun.irradiance * surface.reflected(hit.to_local(to_sun))[0]
        sunlit = goes_on & dr.any(sunlight != 0)
        sunlit &= ~scene.ray_test(hit.spawn_ray_to(hit.p + to_sun * FAR_M), sunlit)
        radiance += dr.select(sunlit, throughput * sunlight, 0)
        # The sky
        if dr.hint(sky is not None, mode="scalar"):
            sky_sampled = goes_on & ~sunlit
            if sky_sampled:
                # Not those by which the Sun is hidden: they would look at a part of the sky alone.
                to_sky, skylight = sky.sample_direction(hit, numbers.scattered)
                value, value_pdf = surface.reflected(hit.to_local(to_sky.d))
                clear = (to_sky.pdf > 0) & dr.any(value != 0)
                clear &= ~scene.ray_test(hit.spawn_ray_to(to_sky.p), clear)
                radiance += dr.select(
                    clear, throughput * value * skylight * _power(to_sky.pdf, value_pdf), 0
                )
        # The next segment
        scattered = surface.scattered(numbers.choice, numbers.scattered)
        value, pdf = surface.reflected(scattered)
        throughput = dr.select(goes_on & (pdf > 0), throughput * value / pdf, 0)
        scatter_pdf = dr.select(goes_on, pdf, scatter_pdf)
        previous = mi.Interaction3f(hit)
        ray = hit.spawn_ray(hit.to_world(scattered))
        depth += 1
        largest = dr.max(throughput)
        survival = dr.minimum(largest, 0.95)
        roulette = depth >= ROULETTE_DEPTH
        throughput = dr.select(roulette & goes_on, throughput / survival, throughput)
        active = goes_on & (largest > 0) & (~roulette | (numbers.roulette < survival))
    return radiance, covered


def _power(pdf: Any, other_pdf: Any) -> Any:
    """Power heuristic with exponent 2: the weight of a sample drawn with density ``pdf``."""
    square = dr.square(pdf)
    return dr.select(pdf > 0, square / (square + dr.square(other_pdf)), 0)
