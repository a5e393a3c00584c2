"""Light that a surface reflects into one direction, by the glTF metallic-roughness material."""

from __future__ import annotations

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._geometry.surface import SurfaceMaterial
from posse_core._model.bands import BAND_CENTRES_M

_DIELECTRIC_F0 = 0.04
_LEAST_COSINE = 1e-4
_LEAST = 1e-60
"""Divisors are not below it: where light and eye are opposite, so that no light is reflected."""


def reflectance_at(base_color: FloatArray, wavelength_m: float) -> FloatArray:
    """(N, 3) linear reflectance in red, green and blue → (N,) at a wavelength.

    It is interpolated between the centres of the bands. Beyond them it is that of the nearest band, as a
    spacecraft's materials say nothing of the infrared.
    """
    blue_first = base_color[:, ::-1]
    place = np.interp(wavelength_m, BAND_CENTRES_M[::-1], np.arange(3.0))
    low = min(int(place), 1)
    return np.asarray(blue_first[:, low] * (1 - (place - low)) + blue_first[:, low + 1] * (place - low))


def reflected_sr(
    material: SurfaceMaterial,
    reflectance: FloatArray,
    normal: FloatArray,
    to_light: FloatArray,
    to_eye: FloatArray,
    widening: FloatArray | float,
) -> FloatArray:
    """Radiance towards the eye over the irradiance on a plate that faces the light: (N,), sr⁻¹.

    It is the BRDF of glTF 2.0 (specification, appendix B) times the cosine of incidence; for a
    Lambertian surface ρ cos θ / π.

    Args:
        material: of N points.
        reflectance: (N,) base colour at the wavelength of the light.
        normal: (N, 3) unit normals on the eye's side.
        to_light, to_eye: (N, 3) unit vectors.
        widening: added to alpha², for light whose direction has a spread.
    """
    n_l = np.maximum(_dot(normal, to_light), 0.0)
    n_v = np.maximum(_dot(normal, to_eye), _LEAST_COSINE)
    between = to_light + to_eye
    half = between / np.maximum(np.linalg.norm(between, axis=-1, keepdims=True), _LEAST)
    n_h = np.maximum(_dot(normal, half), 0.0)
    v_h = np.clip(_dot(to_eye, half), 0.0, 1.0)

    a2 = np.clip(material.roughness**4 + widening, 1e-20, 1.0)
    # 1 − n_h² is computed as |n × h|², because rounding of the difference would spoil a mirror's lobe.
    off = np.sum(np.cross(normal, half) ** 2, axis=-1)
    distribution = a2 / (np.pi * np.maximum((n_h * n_h * a2 + off) ** 2, _LEAST))
    shadowing = 0.5 / np.maximum(
        n_l * np.sqrt(n_v * n_v * (1 - a2) + a2) + n_v * np.sqrt(n_l * n_l * (1 - a2) + a2), _LEAST
    )
    dielectric = 1 - material.metallic
    f0 = _DIELECTRIC_F0 * material.specular * dielectric + reflectance * material.metallic
    f90 = material.specular * dielectric + material.metallic
    fresnel = f0 + (f90 - f0) * (1 - v_h) ** 5
    diffuse = reflectance * dielectric / np.pi * (1 - fresnel * dielectric)
    return np.asarray(n_l * (diffuse + fresnel * distribution * shadowing))


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.sum(a * b, axis=-1))
