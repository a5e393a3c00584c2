"""Surface finishes made by code: foil, solar cells, paints, radiator tiles.

Every texture repeats without a seam, depends on its seed alone, and covers a square with a side of
:data:`TILE_M` unless its docstring says otherwise. Reflectances are typical values of a finish, not
those of a particular flight material.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from posse_core._arrays import AnyArray, FloatArray
from posse_core._frames import unit
from posse_core._model.spacecraft import Material
from posse_core._model.srgb import srgb_from_linear
from posse_core._randomness import random_generator

TILE_M = 1.0
"""Side of the square that a repeating texture covers, m; texture coordinates are therefore metres."""


def srgb(linear: FloatArray) -> AnyArray:
    """Linear reflectance 0 … 1 → sRGB-coded uint8, any shape."""
    return byte(srgb_from_linear(np.clip(linear, 0.0, 1.0)))


def byte(values: FloatArray) -> AnyArray:
    """0 … 1 → uint8, any shape."""
    return np.asarray(np.rint(255.0 * np.clip(values, 0.0, 1.0)), dtype=np.uint8)


def grey(linear: FloatArray) -> AnyArray:
    """Linear reflectance (H, W) → sRGB-coded (H, W, 3) uint8."""
    return np.repeat(srgb(linear)[..., None], 3, axis=2)


def normal_map(slope: FloatArray) -> AnyArray:
    """Slopes (H, W, 2) of a surface, along u and v → tangent-space normals (H, W, 3) uint8."""
    normal = unit(np.concatenate([-slope, np.ones_like(slope[..., :1])], axis=-1))
    return byte(0.5 * (normal + 1.0))


def facets(
    rng: np.random.Generator, size: int, count: int, soft_px: float
) -> tuple[FloatArray, FloatArray]:
    """A periodic pattern of facets, as on crumpled foil.

    Returns:
        (size, size, 2) slope of the facets, of unit variance before the edges are softened, and
        (size, size) a random value 0 … 1 for each facet.
    """
    seeds = rng.uniform(0.0, size, (count, 2))
    tilt = rng.standard_normal((count, 2))
    shade = rng.uniform(0.0, 1.0, count)
    # Every other texel suffices, because the edges are softened below.
    axis = np.arange(1.0, size, 2.0)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    _, nearest = cKDTree(seeds, boxsize=size).query(grid)
    patch = np.kron(np.asarray(nearest).reshape(size // 2, size // 2), np.ones((2, 2), dtype=int))
    slope = gaussian_filter(tilt[patch], (soft_px, soft_px, 0), mode="wrap")
    return slope, gaussian_filter(shade[patch], soft_px, mode="wrap")


def foil(
    name: str,
    color: tuple[float, float, float],
    seed: int,
    wrinkle: float = 0.16,
    roughness: float = 0.28,
) -> Material:
    """Multi-layer insulation: metallised film, crumpled into facets of two sizes, with taped seams.

    Args:
        name: name of the material.
        color: (3,) linear reflectance of the metal as seen through the film.
        seed: determines the texture.
        wrinkle: root-mean-square slope of the facets.
        roughness: mean roughness.
    """
    size = 512
    rng = random_generator(seed, -1, f"foil {name}")
    large, shade = facets(rng, size, 60, 3.0)
    small, fine = facets(rng, size, 900, 1.2)
    slope = wrinkle * np.tanh(0.7 * (large + 0.6 * small)) / 0.7
    row = np.arange(size)
    seam = np.minimum(np.abs(row - 256) / 10.0, 1.0)  # a strip of tape across the middle of a tile
    slope *= (0.25 + 0.75 * seam)[:, None, None]
    value = 0.86 + 0.2 * (shade - 0.5) + 0.12 * (fine - 0.5) - 0.1 * (seam < 1.0)[:, None]
    rough = 1.0 + 0.6 * (fine - 0.5)
    return Material(
        name,
        base_color=color,
        metallic=1.0,
        roughness=min(1.0, roughness * 1.3),
        base_color_texture=grey(value),
        metallic_roughness_texture=byte(np.stack([np.ones_like(rough), rough / 1.3], axis=-1)),
        normal_texture=normal_map(slope),
    )


def film(
    name: str,
    color: tuple[float, float, float],
    seed: int,
    creases: int,
    roughness: float,
    metallic: float = 1.0,
) -> Material:
    """Metallised film that is stretched over a flat side: nearly even, with a few sharp creases.

    Args:
        name: name of the material.
        color: (3,) linear reflectance.
        seed: determines the texture.
        creases: their number on a square metre.
        roughness: of the film between them.
        metallic: share of the film that is metal; the rest is paint.
    """
    size = 512
    rng = random_generator(seed, -1, f"film {name}")
    waves = gaussian_filter(rng.standard_normal((size, size, 2)), (24.0, 24.0, 0), mode="wrap")
    slope = 0.012 * waves / waves.std()
    for _ in range(creases):
        at, angle = rng.uniform(0.0, size, 2), rng.uniform(0.0, np.pi)
        length, width = rng.uniform(0.05, 0.18) * size, rng.uniform(1.2, 3.0)
        steepness = rng.uniform(0.2, 0.6)
        direction = np.array([np.cos(angle), np.sin(angle)])
        # Only the texels near the crease, which may reach over the border of the tile.
        reach = 1.7 * length * np.abs(direction) + 4.0 * width
        columns, rows = (
            np.arange(int(low), int(high) + 1) for low, high in zip(at - reach, at + reach, strict=True)
        )
        dx, dy = np.meshgrid(columns + 0.5 - at[0], rows + 0.5 - at[1])
        along, across = dx * direction[0] + dy * direction[1], dy * direction[0] - dx * direction[1]
        ridge = np.exp(-0.5 * (across / width) ** 2 - (along / length) ** 4)
        steep = steepness * ridge * across / width
        near = np.ix_(rows % size, columns % size)
        slope[near] += steep[..., None] * np.array([-direction[1], direction[0]])
    return Material(
        name,
        base_color=color,
        metallic=metallic,
        roughness=roughness,
        normal_texture=normal_map(slope),
    )


def solar_panel(
    name: str, cells: tuple[int, int], size_px: tuple[int, int], seed: int, back: float = 0.045
) -> Material:
    """Both faces of a flat solar panel: the lower half of the texture is the front, the upper half the
    back.

    A cell is dark blue silicon under cover glass, with clipped corners, fine grid fingers, two busbars
    and gaps to its neighbours. Strings of cells differ slightly in hue. The back is a sheet with the
    wiring of the strings and a harness.

    Args:
        name: name of the material.
        cells: number of cells along u and v on the front.
        size_px: (width, height) of one face, texels.
        seed: determines the texture.
        back: reflectance of the back, for example 0.045 for bare carbon fibre or 0.5 for white paint.
    """
    rng = random_generator(seed, -1, f"solar panel {name}")
    front, rough_front = _cells(cells, size_px, rng)
    rear, rough_rear = _panel_back(size_px, back, rng)
    # Row 0 of a texture is its top, at v = 1.
    color = np.concatenate([rear, front], axis=0)
    rough = np.concatenate([rough_rear, rough_front], axis=0)
    return Material(
        name,
        roughness=1.0,
        base_color_texture=srgb(color),
        metallic_roughness_texture=byte(np.stack([np.zeros_like(rough), rough], axis=-1)),
    )


def solar_cells(name: str, cells: tuple[int, int], size_px: tuple[int, int], seed: int) -> Material:
    """Solar cells without a back, covering uv 0 … 1 once, for body-mounted arrays."""
    front, rough = _cells(cells, size_px, random_generator(seed, -1, f"solar cells {name}"))
    return Material(
        name,
        roughness=1.0,
        base_color_texture=srgb(front),
        metallic_roughness_texture=byte(np.stack([np.zeros_like(rough), rough], axis=-1)),
    )


def _cells(
    cells: tuple[int, int], size_px: tuple[int, int], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Linear colour (H, W, 3) and roughness (H, W) of an array of cells with a bare rim."""
    (across, up), (width, height) = cells, size_px
    one, one_rough = _cell((width - 12) // across, (height - 12) // up)
    hue = rng.normal(0.0, 1.0, (up, across)) + 1.5 * rng.normal(0.0, 1.0, (up, 1))
    shade = np.kron(np.exp(0.10 * hue), np.ones(one_rough.shape))
    sheet = np.tile(one, (up, across, 1)) * shade[..., None]
    rough = np.tile(one_rough, (up, across))
    color = np.broadcast_to(np.array(_SUBSTRATE), (height, width, 3)).copy()
    full_rough = np.full((height, width), 0.7)
    top, left = (height - sheet.shape[0]) // 2, (width - sheet.shape[1]) // 2
    inner = slice(top, top + sheet.shape[0]), slice(left, left + sheet.shape[1])
    color[inner], full_rough[inner] = sheet, rough
    return color, full_rough


_SUBSTRATE = (0.33, 0.31, 0.27)
"""Linear colour of the gaps between the cells."""


def _cell(width: int, height: int) -> tuple[FloatArray, FloatArray]:
    """Linear colour (height, width, 3) and roughness (height, width) of one cell, drawn at four times
    the resolution and averaged."""
    fine = 4
    x = (np.arange(width * fine) + 0.5) / (width * fine)
    y = ((np.arange(height * fine) + 0.5) / (height * fine))[:, None]
    inside = (np.abs(x - 0.5) < 0.475) & (np.abs(y - 0.5) < 0.475)
    inside &= np.abs(x - 0.5) + np.abs(y - 0.5) < 0.86  # clipped corners
    busbar = inside & (np.abs(np.abs(y - 0.5) - 0.22) < 0.012)
    fingers = 1.0 + 0.25 * (0.5 + 0.5 * np.cos(2.0 * np.pi * 12.0 * x))
    silicon = np.array([0.010, 0.016, 0.060]) * np.broadcast_to(fingers, inside.shape)[..., None]
    color = np.where(busbar[..., None], (0.24, 0.25, 0.28), silicon)
    color = np.where(inside[..., None], color, _SUBSTRATE)
    rough = np.where(inside, 0.12, 0.7)
    blocks = (height, fine, width, fine)
    return color.reshape(*blocks, 3).mean(axis=(1, 3)), rough.reshape(blocks).mean(axis=(1, 3))


def _panel_back(
    size_px: tuple[int, int], reflectance: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    width, height = size_px
    weave = 1.0 + 0.09 * rng.standard_normal((height, width))
    color = np.repeat((reflectance * weave)[..., None], 3, axis=2)
    x = (np.arange(width) + 0.5) / width
    y = (np.arange(height) + 0.5) / height
    runs = np.abs((x * 12.0) % 1.0 - 0.5) < 0.02  # the wires of each string
    harness = np.abs(y - 0.5) < 0.03
    rim = (np.minimum(y, 1.0 - y)[:, None] < 0.03) | (np.minimum(x, 1.0 - x)[None, :] < 0.006)
    color[:, runs] = (0.22, 0.13, 0.04)
    color[harness] = (0.42, 0.24, 0.05)  # a kapton-wrapped harness
    color[rim] = (0.32, 0.32, 0.33)
    return np.clip(color, 0.0, 1.0), np.full((height, width), 0.6)


def paint(name: str, reflectance: float, seed: int) -> Material:
    """Matt paint that is slightly uneven. A white radiator has the reflectance 0.8, a black baffle
    0.04."""
    size = 256
    noise = random_generator(seed, -1, f"paint {name}").standard_normal((size, size))
    cloud = gaussian_filter(noise, 12.0, mode="wrap")
    value = 0.94 + 0.03 * cloud / cloud.std()
    return Material(
        name,
        base_color=(reflectance, reflectance, 0.97 * reflectance),
        roughness=0.75,
        base_color_texture=grey(value),
    )


def metal(name: str, color: tuple[float, float, float], roughness: float) -> Material:
    """Bare machined metal."""
    return Material(name, base_color=color, metallic=1.0, roughness=roughness)


def mirror_tiles(name: str, seed: int) -> Material:
    """An optical solar reflector: second-surface mirrors, 25 per metre, each slightly tilted."""
    size, count = 512, 25
    rng = random_generator(seed, -1, f"mirrors {name}")
    position = (np.arange(size) + 0.5) / size * count
    cell = np.floor(position).astype(int)
    x, y = np.meshgrid(position - cell, position - cell)
    gap = (np.abs(x - 0.5) > 0.46) | (np.abs(y - 0.5) > 0.46)
    tilt = 0.012 * rng.standard_normal((count, count, 2))
    slope = np.where(gap[..., None], 0.0, tilt[np.ix_(cell, cell)])
    value = np.where(gap, 0.35, 0.93)
    return Material(
        name,
        base_color=(0.9, 0.92, 0.95),
        metallic=1.0,
        roughness=1.0,
        base_color_texture=grey(value),
        metallic_roughness_texture=byte(
            np.stack([np.where(gap, 0.0, 1.0), np.where(gap, 0.7, 0.08)], axis=-1)
        ),
        normal_texture=normal_map(slope),
    )
