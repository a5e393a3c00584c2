"""Bodies with known temperatures, and suns to heat them."""

from __future__ import annotations

import numpy as np

from posse_core import Material, Part, Spacecraft
from posse_core._arrays import FloatArray
from posse_core._sensors.thermal.heating import Surroundings
from posse_core._sensors.thermal.model import ThermalModel
from posse_core._sensors.thermal.surfaces import Surface
from posse_core.testing import scenes

SUN_W_M2 = 1361.0
SIGMA = 5.670374419e-8


def box(name: str, half_m: tuple[float, float, float], centre_m=(0.0, 0.0, 0.0)) -> Part:
    """A closed box of twelve triangles; faces 2k and 2k+1 are its side k: −x, +x, −y, +y, −z, +z."""
    corners, faces = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            out, u, v = (np.roll([1.0, 0.0, 0.0], axis + k) for k in range(3))
            first, second = (u, v) if sign > 0 else (v, u)
            start = len(corners)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corners.append((sign * out + a * first + b * second) * half_m)
            faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    vertices = np.array(corners) + centre_m
    normals = np.zeros((len(vertices), 3), dtype=np.float32)
    uv = np.zeros((len(vertices), 2), dtype=np.float32)
    return Part(name, vertices, np.array(faces, dtype=np.int32), normals, uv, "plain")


def craft(*parts: Part) -> Spacecraft:
    return Spacecraft("body", parts, {"plain": Material("plain")})


def model(
    *parts: Part,
    absorptance: float = 0.6,
    emissivity: float = 0.8,
    facet_m: float = 100.0,
    thin_m: float = 0.05,
    **more: float,
) -> ThermalModel:
    surfaces = [Surface(absorptance, emissivity, **more)] * len(parts)
    return ThermalModel.of(craft(*parts), surfaces, facet_m=facet_m, thin_m=thin_m)


def sunshine(
    direction: tuple[float, float, float],
    *,
    t_s: float = 0.0,
    sun_w_m2: float = SUN_W_M2,
    omega_rad_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Surroundings:
    """The Sun alone, far from the Earth."""
    none = np.zeros(1)
    return Surroundings(
        t_s=t_s,
        sun_direction=np.array(direction) / np.linalg.norm(direction),
        sun_w_m2=sun_w_m2,
        sun_share=float(sun_w_m2 > 0),
        earth_directions=np.array([[1.0], [0.0], [0.0]]),
        earth_reflected_w_m2=none,
        earth_emitted_w_m2=none,
        omega_rad_s=np.array(omega_rad_s),
    )


def plate(half_m: float = 0.5) -> Part:
    """A square sheet with the normal +z and a surface on both sides."""
    return scenes.rectangle("plate", "plain", u_m=(half_m, 0.0, 0.0), v_m=(0.0, half_m, 0.0))


def equilibrium_k(absorbed_w_m2: FloatArray | float, emissivity: float) -> FloatArray:
    """Temperature of a surface that emits what it absorbs, if the cosmic background were none."""
    return np.asarray((np.asarray(absorbed_w_m2) / (emissivity * SIGMA)) ** 0.25)
