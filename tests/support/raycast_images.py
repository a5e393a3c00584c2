"""Images of small spacecraft by the ray caster, and what the refiner makes of them at a pose."""

from __future__ import annotations

import contextlib
import os
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import CraftState, EnvironmentMap, PixelBox, RenderRequest, Scene, Spacecraft
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Crop, Picture, binned, scales
from posse_core._refinement.light import Light, drawn_apart, fitted, together
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.render_compare import RenderCompare
from posse_core._refinement.studio import Studio, scaled
from posse_core.testing import refiners, scenes

CAMERA = scenes.camera(256, 192, np.radians(30))
SUN = np.array([0.4, -0.5, -0.77]) / np.linalg.norm([0.4, -0.5, -0.77])
RAYS = 3
"""Rays to each side of a pixel of an image."""
HERE = Placement(
    Rotation.from_euler("xyz", (20, -35, 15), degrees=True).as_matrix(), np.array([0.05, -0.05, 5.2])
)
BUS = refiners._cuboid("bus", (-0.5, -0.4, -0.35), (0.5, 0.4, 0.35), "cells")

# The ray caster, by which the refiners of most tests draw, takes minutes for so many drawings.
# Where raster is required, its absence is to fail the test and not to skip it: so no importorskip.
needs_raster = pytest.mark.skipif(
    find_spec("posse_render_raster") is None and "POSSE_REQUIRE_RASTER" not in os.environ,
    reason="posse-render-raster, which draws what is compared, is not installed",
)


def box_of(is_on: np.ndarray) -> np.ndarray:
    """(4,) around pixels (h, w)."""
    rows, columns = (np.flatnonzero(is_on.any(axis=axis)) for axis in (1, 0))
    first = np.array([columns[0], rows[0]])
    return np.concatenate([first, np.array([columns[-1], rows[-1]]) + 1 - first]).astype(float)


def light_of(
    craft: Spacecraft,
    place: Placement = HERE,
    sun: np.ndarray = SUN,
    sky: EnvironmentMap | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Brightness and coverage (h, w) under the Sun, each pixel the mean of many rays."""
    fine = scaled(CAMERA, RAYS)
    state = CraftState(
        *place,
        sun_direction_cam=sun,
        sun_irradiance_rgb_w_m2=np.full(3, np.pi),
        sun_angular_radius_rad=0.0047,
    )
    box = PixelBox(0, 0, fine.width_px, fine.height_px)
    light = refiners._renderer("", {}, Scene(craft, fine)).render(RenderRequest(state, box, sky, 0))
    return binned(light.radiance_rgb.mean(axis=-1), RAYS), binned(light.coverage, RAYS)


def fits(
    craft: Spacecraft,
    seen: np.ndarray,
    sun: np.ndarray = SUN,
    place: Placement = HERE,
    apart_px: float = 1.0,
) -> list[tuple[Crop, Light, float]]:
    """Crop, light and agreement at a pose, by default the true one, from the coarsest scale to the
    finest."""
    vertices_m = np.concatenate([part.vertices_body_m for part in craft.parts])
    picture = Picture(np.float32(seen), CAMERA, None, is_linear=True)
    made = []
    with contextlib.closing(
        Studio(RefinerSetting(craft, CAMERA, refiners._renderer), RenderCompareOptions().renderer)
    ) as studio:
        for scale in scales(picture.extent_px(place, vertices_m), (48.0, 96.0, 192.0)):
            crop = picture.crop(place, vertices_m, scale)
            assert crop is not None
            shown = drawn_apart(crop, studio, place, sun)
            light = fitted(crop, shown, sun, 0.4, apart_px)
            agreement = LitComparer(crop, studio, light).agreement(together(shown, light.lights))
            made.append((crop, light, agreement))
    assert made[0][0].scale.binned > 1
    return made


def opened(craft: Spacecraft) -> RenderCompare:
    refiner = RenderCompare(RenderCompareOptions())
    refiner.open(RefinerSetting(craft, CAMERA, refiners._renderer))
    return refiner


def with_booms(w: float, bus: tuple[float, float, float]) -> Spacecraft:
    """A bus and two booms, by half of their widths in metres."""
    x, y, z = bus
    parts = (
        refiners._cuboid("bus", (-x, -y, -z), (x, y, z), "cells"),
        refiners._cuboid("long", (-w, -1.3, -w), (w, 1.3, w), "white"),
        refiners._cuboid("short", (0.1, -w, -w), (1.2, w, w), "white"),
    )
    return replace(refiners._craft(), parts=parts)
