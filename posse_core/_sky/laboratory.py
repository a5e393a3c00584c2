"""A dark room with light boxes in place of space: radiance by direction, drawn anew for each frame.

It stands for test rooms such as Stanford's TRON, in which the photographs of SPEED+ and SHIRT were
taken. What the room shows does not depend on where the camera stands in it, as with a sky.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._arrays import Float32Array, FloatArray
from posse_core._frames import unit
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.camera import Camera, PixelBox
from posse_core._randomness import random_generator
from posse_core._scenario.sky import LaboratoryConfig

WHITE = SOLAR_BAND_FRACTIONS / SOLAR_BAND_FRACTIONS.sum()
"""(3,) share of the red, green and blue band in the light of lamps."""
_SOFT_EDGE = 0.06
"""Width of a box's border, as a share of its half sides, over which its light falls to nothing."""
_PATCHES = 6
"""Lighter patches of the walls."""
_PATCH_SHARPNESS = (2.0, 60.0)
"""Least and greatest concentration of a patch (von Mises and Fisher): from half the room to 10°."""
_BLOCK_ROWS = 64


@dataclass(frozen=True)
class Room:
    """The room around one frame.

    Attributes:
        boxes: rotation (3, 3) of each box's axes to camera axes; its middle is along its z.
        half_sides: (B, 2) tangents of half the angles that a box covers along its x and y.
        boxes_w_m2_sr: (B,) radiance of each, all bands together.
        patches: (P, 3) directions of lighter patches of the walls, camera axes.
        sharpness, patches_w_m2_sr: (P,) concentration and radiance of each.
    """

    boxes: FloatArray
    half_sides: FloatArray
    boxes_w_m2_sr: FloatArray
    patches: FloatArray
    sharpness: FloatArray
    patches_w_m2_sr: FloatArray

    @classmethod
    def drawn(cls, config: LaboratoryConfig, seed: int, index: int) -> Room:
        """The room of a frame: seed of the run, index of the frame."""
        random = random_generator(seed, index, "laboratory")
        count = int(random.integers(config.boxes[0], config.boxes[1] + 1))
        sides = np.radians(random.uniform(*config.box_deg, (count, 2)))
        # Boxes are beside the camera or behind it, and never behind the spacecraft.
        off_axis = np.arccos(random.uniform(-1.0, np.cos(np.radians(config.off_axis_deg)), count))
        around, roll = random.uniform(0.0, 2.0 * np.pi, (2, count))
        angles = np.column_stack([around, off_axis, roll])
        least, greatest = config.box_w_m2_sr
        broad, sharp = _PATCH_SHARPNESS
        return cls(
            boxes=Rotation.from_euler("ZYZ", angles).as_matrix().reshape(-1, 3, 3),
            half_sides=np.tan(sides / 2.0),
            boxes_w_m2_sr=least * (greatest / least) ** random.uniform(size=count),
            patches=unit(random.standard_normal((_PATCHES, 3))),
            sharpness=broad * (sharp / broad) ** random.uniform(size=_PATCHES),
            patches_w_m2_sr=random.uniform(*config.wall_w_m2_sr) * random.dirichlet(np.ones(_PATCHES)),
        )

    def radiance_rgb(self, directions: FloatArray) -> Float32Array:
        """(..., 3) directions in camera axes → (..., 3) radiance, W m⁻² sr⁻¹."""
        d = unit(directions)
        light = np.zeros(d.shape[:-1])
        for middle, sharpness, w_m2_sr in zip(
            self.patches, self.sharpness, self.patches_w_m2_sr, strict=True
        ):
            light += w_m2_sr * np.exp(sharpness * (d @ middle - 1.0))
        for R, half, w_m2_sr in zip(self.boxes, self.half_sides, self.boxes_w_m2_sr, strict=True):
            x, y, z = np.moveaxis(d @ R, -1, 0)
            ahead = np.maximum(z, 1e-9)
            outside = np.maximum(np.abs(x) / (half[0] * ahead), np.abs(y) / (half[1] * ahead))
            light += w_m2_sr * (z > 0) * np.clip((1.0 - outside) / _SOFT_EDGE + 0.5, 0.0, 1.0)
        return np.asarray(light[..., None] * WHITE, dtype=np.float32)


def background(
    room: Room, camera: Camera, first_row: int, rows: int
) -> Iterator[tuple[PixelBox, Float32Array]]:
    """Boxes of some rows of an image, and the room's radiance (h, w, 3) in each."""
    for top in range(first_row, first_row + rows, _BLOCK_ROWS):
        height = min(_BLOCK_ROWS, first_row + rows - top)
        box = PixelBox(0, top, camera.width_px, height)
        yield box, room.radiance_rgb(camera.rays(box.pixel_centres_px()))
