"""A renderer for tests of the pipeline: one grey over the silhouette, and deaths on demand."""

import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from posse_core import (
    Annotator,
    ComponentSpec,
    Labels,
    Options,
    Radiance,
    RayCaster,
    Renderer,
    WorkerLost,
    hookimpl,
)


@hookimpl
def posse_renderers():
    return [ComponentSpec("flat", "one grey", "posse_flat:Flat", "posse_flat:FlatOptions")]


@hookimpl
def posse_annotators():
    return [
        ComponentSpec("nearest", "the nearest visible point", "posse_flat:Nearest"),
        ComponentSpec("range_m", "has the name of a label", "posse_flat:Nearest"),
    ]


class Nearest(Annotator):
    def annotate(self, look):
        view = look.view()
        return Labels({"nearest_m": float(view.depth_m[view.mask].min())})


class FlatOptions(Options):
    radiance_w_m2_sr: float = 5.0
    seconds: float = 0.0


class Flat(Renderer):
    """Environment: FLAT_KILL=FRAME dies there each time; FLAT_KILL_ONCE=FRAME,FILE once, by the file;
    FLAT_RAISE=FRAME raises there; FLAT_HANG_ONCE=FRAME,FILE never comes back from there, once;
    FLAT_LOSE=FRAME says there each time that a process of its own has died, FLAT_LOSE_ONCE=FRAME,FILE
    once."""

    def open(self, scene):
        # A request is of one instant, under a rolling shutter too.
        self.camera = replace(scene.camera, line_time_s=0.0)
        self.caster = RayCaster(replace(scene, camera=self.camera))

    def render(self, request):
        index = str(request.index)
        time.sleep(self.options.seconds)
        if os.environ.get("FLAT_KILL") == index:
            os.kill(os.getpid(), signal.SIGKILL)
        if self._first_time("FLAT_KILL_ONCE", index):
            os.kill(os.getpid(), signal.SIGKILL)
        if self._first_time("FLAT_HANG_ONCE", index):
            time.sleep(3600)
        if os.environ.get("FLAT_LOSE") == index or self._first_time("FLAT_LOSE_ONCE", index):
            raise WorkerLost("the lamp's process has died")
        if os.environ.get("FLAT_RAISE") == index:
            raise RuntimeError("the lamp is broken")
        coverage = self._silhouette(request)
        light = np.repeat(coverage[..., None] * np.float32(self.options.radiance_w_m2_sr), 3, axis=2)
        return Radiance(request.box, light, coverage)

    def _silhouette(self, request):
        view = self.caster.view(request.craft)
        covered = np.zeros((self.camera.height_px, self.camera.width_px), np.float32)
        covered[view.box.slices] = view.hit
        return covered[request.box.slices]

    def _first_time(self, variable, index):
        once, _, marker = os.environ.get(variable, "").partition(",")
        if once != index or Path(marker).exists():
            return False
        Path(marker).touch()
        return True

    def close(self):
        pass

    def describe(self):
        return {"flat": "1"}
