"""Two names of one renderer for tests of the crosscheck: Lambert's law by ray-casting, with faults that
its options set."""

import os
import signal
from dataclasses import replace

import numpy as np

from posse_core import Camera, ComponentSpec, Options, Radiance, RayCaster, Renderer, hookimpl

FINE = 5


@hookimpl
def posse_renderers():
    words = frozenset({"path-traced", "depth"})
    names = ("crooked", "upright")
    return [
        ComponentSpec(n, "by ray-casting", "posse_crooked:Crooked", "posse_crooked:Faults", words)
        for n in names
    ]


class Faults(Options):
    gain: float = 1.0
    shift_px: float = 0.0
    depth_offset_m: float = 0.0
    dies_in_frame: int = -1


class Crooked(Renderer):
    def open(self, scene):
        camera = scene.camera
        fine = Camera(
            camera.width_px * FINE,
            camera.height_px * FINE,
            camera.fx_px * FINE,
            camera.fy_px * FINE,
            (camera.cx_px + 0.5 + self.options.shift_px) * FINE - 0.5,
            (camera.cy_px + 0.5) * FINE - 0.5,
            camera.sensor_width_m,
        )
        self.camera = camera
        colours = [piece.material.base_color for piece in scene.pieces]
        self.colours = np.array([*colours, (0, 0, 0)])
        self.caster, self.fine = RayCaster(scene), RayCaster(replace(scene, camera=fine))

    def render(self, request):
        craft, box = request.craft, request.box
        if self.options.dies_in_frame == request.index:
            os.kill(os.getpid(), signal.SIGKILL)
        view = self.fine.view(craft)
        cosine = np.maximum(np.nan_to_num(view.normal_cam) @ craft.sun_direction_cam, 0) * view.lit
        light = cosine[..., None] * self.colours[view.part_id] * craft.sun_irradiance_rgb_w_m2 / np.pi
        shape = (self.camera.height_px, self.camera.width_px)
        radiance = np.zeros((shape[0] * FINE, shape[1] * FINE, 3))
        covered = np.zeros(radiance.shape[:2])
        radiance[view.box.slices], covered[view.box.slices] = light, view.hit
        radiance = radiance.reshape(shape[0], FINE, shape[1], FINE, 3).mean(axis=(1, 3))
        coverage = covered.reshape(shape[0], FINE, shape[1], FINE).mean(axis=(1, 3))
        depth = np.full(shape, np.nan, np.float32)
        exact = self.caster.view(craft)
        depth[exact.box.slices] = exact.depth_m + self.options.depth_offset_m
        return Radiance(
            box,
            (self.options.gain * radiance[box.slices]).astype(np.float32),
            coverage[box.slices].astype(np.float32),
            depth[box.slices],
        )

    def close(self):
        pass

    def describe(self):
        return {"crooked": "1"}
