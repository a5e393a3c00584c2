"""One simulated frame: image, labels, arrays, and the light that the image was made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posse_core._arrays import AnyArray, Float32Array
from posse_core._model.camera import Camera
from posse_core._model.label_line import LabelLine
from posse_core._model.light import Light
from posse_core._model.reading import Reading
from posse_core._model.scene import FrameState


@dataclass(frozen=True)
class Frame:
    """What a camera takes at one state, and the truth of it. H and W are the image's height and width.

    Attributes:
        state: what was photographed.
        image: (H, W) or (H, W, 3) red-green-blue digital numbers, uint8 or uint16.
        exposure_s: how long the shutter was open.
        labels: the frame's label line, by the annotators of the scenario.
        arrays: full-size (H, W, ...) arrays by name, as in ``depth_m`` and ``part_id``.
        light: that the image was made of.
        readings: of the sensors beside the camera, by the sensor's name, in order of their instants.
    """

    state: FrameState
    camera: Camera
    image: AnyArray
    exposure_s: float
    labels: LabelLine
    arrays: Mapping[str, AnyArray]
    light: Light
    readings: Mapping[str, tuple[Reading, ...]]

    @property
    def index(self) -> int:
        """Number of the frame."""
        return self.state.index

    @cached_property
    def craft_radiance_rgb(self) -> Float32Array:
        """(H, W, 3) linear radiance of the spacecraft, W m⁻² sr⁻¹ in the red, green and blue band.

        It is averaged over the pixel, the part that the craft does not cover counting as black.
        """
        out = np.zeros((self.camera.height_px, self.camera.width_px, 3), dtype=np.float32)
        if self.light.craft is not None:
            out[self.light.craft.box.slices] = self.light.craft.radiance_rgb
        return out

    @cached_property
    def sky_radiance_rgb(self) -> Float32Array:
        """(H, W, 3) linear radiance of the sky as if the spacecraft were not there, W m⁻² sr⁻¹.

        Stars are not in it: they are points without a radiance, in ``light.sky``.
        """
        if self.light.sky.radiance_rgb is not None:
            return self.light.sky.radiance_rgb
        return np.zeros((self.camera.height_px, self.camera.width_px, 3), dtype=np.float32)

    @cached_property
    def coverage(self) -> Float32Array:
        """(H, W) share of each pixel that the spacecraft covers, 0 … 1."""
        out = np.zeros((self.camera.height_px, self.camera.width_px), dtype=np.float32)
        if self.light.craft is not None:
            out[self.light.craft.box.slices] = self.light.craft.coverage
        return out

    def __repr__(self) -> str:
        size = f"{self.camera.width_px} × {self.camera.height_px}"
        range_m = self.state.craft.range_m
        return f"<Frame {self.index}: {size}, t = {self.state.t_s:g} s, range {range_m:.1f} m>"
