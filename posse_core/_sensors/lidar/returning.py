"""The light of a lidar's beams that returns from the spacecraft."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._frames import turned
from posse_core._geometry.rows import by_link
from posse_core._geometry.surface import Surface
from posse_core._interfaces.look import SensorLook
from posse_core._model.bands import solar_fraction_m
from posse_core._sensors.lidar.beams import Beams
from posse_core._sensors.lidar.echoes import echoes
from posse_core._sensors.lidar.options import LidarOptions
from posse_core._sensors.lidar.receiver import Receiver
from posse_core._sensors.lidar.reflection import reflectance_at, reflected_sr


@dataclass(frozen=True)
class Returning:
    """What returns along N beams, before any error.

    Attributes:
        axis_range_m: (N,) distance along the beam's axis; NaN if it meets nothing.
        range_m: (N,) range of the echo that is measured; NaN where nothing returns.
        spread_m: (N,) standard deviation of the distances of its rays.
        signal_e: (N,) its expected electrons, 0 where nothing returns.
        background_e: (N,) expected electrons of sunlight during the pulse.
        part_id: (N,) the part that contributes most to it; −1 where nothing returns.
    """

    axis_range_m: FloatArray
    range_m: FloatArray
    spread_m: FloatArray
    signal_e: FloatArray
    background_e: FloatArray
    part_id: IntArray

    @classmethod
    def joined(cls, blocks: Iterable[Self]) -> Self:
        """Several blocks of beams, one after the other."""
        columns = [[getattr(block, field.name) for field in fields(cls)] for block in blocks]
        return cls(*(np.concatenate(column) for column in zip(*columns, strict=True)))


def returning(
    look: SensorLook, beams: Beams, surface: Surface, receiver: Receiver, options: LidarOptions
) -> Returning:
    """Send beams, each at its own instant."""
    count, rays, _ = beams.rays.shape
    directions = beams.rays.reshape(-1, 3)
    if beams.together:
        axis_range_m = look.rays(beams.axis).distance_m
        hits = look.rays(directions)
    else:
        axis_range_m = look.rays(beams.axis, after_s=beams.after_s).distance_m
        hits = look.rays(directions, after_s=np.repeat(beams.after_s, rays))

    on = np.flatnonzero(hits.hit)
    beam = on // rays
    triangle, point_body_m = hits.triangle[on], hits.point_body_m[on]
    craft = look.state.craft
    shading = surface.normals(triangle, point_body_m)
    normal = np.empty_like(shading)
    for body, link, points in by_link(look.scene, hits.part_id[on]):
        R_sensor_from_link, _ = craft.bodies[body].link_poses_after(link, beams.after_s)
        normal[points] = np.einsum("nij,nj->ni", R_sensor_from_link[beam[points]], shading[points])
    behind = np.sum(normal * hits.normal[on], axis=-1) < 0
    normal[behind] *= -1
    material = surface.at(triangle, point_body_m, look.scene.materials(craft))
    reflectance = reflectance_at(material.base_color, options.wavelength_m)
    to_sensor, range_m = -directions[on], hits.distance_m[on]

    # A mirror sends light back into the cone of a ray, and into the cone that the aperture subtends from
    # its own image behind the mirror.
    widening = beams.widening + (options.receiver.aperture_m / 4 / range_m) ** 2
    reflected = reflected_sr(material, reflectance, normal, to_sensor, to_sensor, widening)
    signal_e = np.zeros(len(directions))
    signal_e[on] = receiver.signal_e(beams.energy_j / rays, reflected, range_m)

    to_sun = turned(craft.sun_direction_cam, -craft.rates.omega_camera_rad_s, beams.after_s[beam])
    to_sun = np.broadcast_to(to_sun, to_sensor.shape)
    sunlight_w_m2_m = (
        look.state.solar_flux_w_m2
        * look.state.sun_fraction_target
        * solar_fraction_m(options.wavelength_m)
    )
    disc = (craft.sun_angular_radius_rad / 2) ** 2
    sunlit = hits.lit[on] * reflected_sr(material, reflectance, normal, to_sun, to_sensor, disc)
    radiance = sunlight_w_m2_m * np.bincount(beam, sunlit, count) / rays
    background_e = receiver.background_e(radiance, beams.field_sr)

    echo = echoes(
        hits.distance_m.reshape(count, rays),
        signal_e.reshape(count, rays),
        receiver.gap_m,
        options.ranging.echo,
        receiver.threshold_e(background_e),
    )
    part_id = hits.part_id.reshape(count, rays)[np.arange(count), echo.ray]
    return Returning(
        axis_range_m=np.where(np.isfinite(axis_range_m), axis_range_m, np.nan),
        range_m=echo.range_m,
        spread_m=echo.spread_m,
        signal_e=echo.signal,
        background_e=background_e,
        part_id=np.where(echo.signal > 0, part_id, -1),
    )
