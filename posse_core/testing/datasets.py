"""Small datasets, for tests of what reads one."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._interfaces.renderer import Renderer
from posse_core._model.scene import Radiance, RenderRequest, Scene
from posse_core._plugins.loading import Plugins
from posse_core._plugins.options import NoOptions
from posse_core._plugins.registry import ComponentSpec
from posse_core._run.plan import make_plan
from posse_core._run.recording import recording
from posse_core._run.worker import write_frame, write_renderer
from posse_core._scenario.load import load_scenario
from posse_core._simulator.simulator import Simulator

_SCENARIO: Mapping[str, Any] = {
    "target": {"name": "cubesat"},
    "orbit": {
        "elements": {
            "epoch_utc": "2022-01-31T02:02:27.58",
            "a_m": 7080000,
            "e": 0.001,
            "i_deg": 98,
            "raan_deg": 10,
            "argp_deg": 20,
            "mean_anomaly_deg": 30,
        }
    },
    "relative": {"roe_m": [0, 0, 1.8, 0.7, 1.8, 0.7]},
    "times": {"duration_orbits": 1, "count": 5},
    "attitude": {"camera": {"law": "pointing-error", "jitter_deg": [14.0, 14.0, 5.0]}},
    "camera": {"width_px": 96, "height_px": 72, "hfov_deg": 30},
    "sky": {"earth": False, "stars": None},
    "renderer": {"name": "even"},
    "annotators": ["box", "mask", "parts", "depth", "normals", "keypoints", "pose"],
    "writers": [],
    "seed": 7,
}
_INSPECTOR = {
    "spacecraft": {"name": "cubesat"},
    "relative": {"roe_m": [0, 0, 0.4, 0.1, 0.4, 0.1]},
    "attitude": {"law": "nadir"},
}
VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "plain": {},
    "a lens that distorts": {"camera.distortion": [-0.1, 0.02, 0.0, 0.0, 0.0]},
    "a rational lens": {"camera.distortion": [-0.1, 0.02, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0]},
    "a rolling shutter": {"camera.line_time_s": 1e-5},
    "joints that move": {"joints": {"wing_left": {"law": "rate", "rate_deg_s": 0.01}}},
    "a body beside the target": {"bodies": {"inspector": _INSPECTOR}},
    "poses alone": {"annotators": ["pose"]},
}
"""Name of a dataset → the keys in which its scenario differs from the plain one's."""


class EvenRenderer(Renderer[NoOptions]):
    """The same light wherever the box of the bodies is."""

    def open(self, scene: Scene) -> None:
        """See :class:`posse_core.Renderer`."""

    def render(self, request: RenderRequest) -> Radiance:
        shape = (request.box.height, request.box.width)
        light = np.full((*shape, 3), 5.0, dtype=np.float32)
        return Radiance(request.box, light, np.ones(shape, dtype=np.float32))

    def close(self) -> None:
        """See :class:`posse_core.Renderer`."""


@cache
def small_dataset(variant: str) -> Path:
    """The folder of a dataset of :data:`VARIANTS`, which is made once; not to be changed.

    Five frames of a CubeSat some metres away, 96 by 72 pixels; in some it is cut by the border, and in
    one it is out of view.
    """
    folder = _home() / variant.replace(" ", "-")
    plugins = Plugins([])
    spec = ComponentSpec("even", "the same light everywhere", f"{__name__}:EvenRenderer")
    plugins.registry.add("renderer", spec, "testing")
    plan = make_plan(load_scenario(_SCENARIO, plugins.registry, VARIANTS[variant]), plugins.registry)
    frames = len(plan.trajectory)
    with (
        recording(
            str(folder),
            plan.scenario,
            plan.scene,
            frames,
            plugins,
            trajectory=plan.trajectory,
            resume=False,
        ) as dataset,
        Simulator(plan.scenario, plugins.registry, plan.trajectory) as simulator,
    ):
        dataset.begin()
        write_renderer(simulator, dataset.store)
        for index in range(frames):
            dataset.add(write_frame(simulator.frame(simulator.state(index)), dataset.store))
        dataset.finish({})
    return folder


@cache
def _home() -> Path:
    """A folder that is removed when the process ends."""
    home = tempfile.TemporaryDirectory(prefix="posse-datasets-")
    _kept.append(home)
    return Path(home.name)


_kept: list[tempfile.TemporaryDirectory[str]] = []
