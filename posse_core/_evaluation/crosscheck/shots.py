"""Rendering a case by one renderer, in a worker process of its own."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._arrays import Float32Array
from posse_core._evaluation.crosscheck.settings import Case
from posse_core._evaluation.crosscheck.silhouette import Geometry
from posse_core._interfaces.executor import Executor, FrameResult
from posse_core._model.scene import RenderRequest
from posse_core._plugins.loading import load_plugins
from posse_core._randomness import derived_seed
from posse_core._scenario.component import ComponentChoice
from posse_core._simulator.reopening import chosen_renderer

NOISE_FRAMES = 3
"""Frames that are rendered with a second seed too."""


@dataclass(frozen=True)
class Shot:
    """One picture; arrays as in :class:`posse_core.Radiance`.

    Attributes:
        seconds: that the renderer took.
        opening_s: that opening it took, in the first frame of its worker; else None.
    """

    radiance_rgb: Float32Array
    coverage: Float32Array
    depth_m: Float32Array | None
    seconds: float
    opening_s: float | None


@dataclass(frozen=True)
class Taken:
    """What a worker returns of a picture that it has taken.

    Attributes:
        seconds, opening_s: as in :class:`Shot`.
        describe: what the renderer says of itself.
    """

    seconds: float
    opening_s: float | None
    describe: Mapping[str, str]


class Shooter:
    """The frame worker: jobs 0 … F−1 are the frames, F + i is frame i with another seed."""

    def __init__(self, case: Case, choice: ComponentChoice, folder: Path) -> None:
        self._folder = folder
        self._setting = case.build()
        self._geometry = Geometry(self._setting.scene)
        start = time.perf_counter()
        self._renderer = chosen_renderer(load_plugins().registry, choice)
        self._renderer.open(self._setting.scene)
        self._opening_s: float | None = time.perf_counter() - start

    def make(self, index: int) -> Taken:
        """Render one job into ``folder/INDEX.npz``; says how long it took."""
        setting = self._setting
        frame = setting.frames[index % len(setting.frames)]
        draw = index // len(setting.frames)
        seed = derived_seed(setting.seed, frame.index, f"crosscheck {draw}")
        environment = setting.environment(frame)
        request = RenderRequest(frame.craft, self._geometry.box(frame), environment, seed, frame.index)
        start = time.perf_counter()
        image = self._renderer.render(request)
        seconds = time.perf_counter() - start
        arrays: dict[str, Any] = {"radiance_rgb": image.radiance_rgb, "coverage": image.coverage}
        if image.depth_m is not None:
            arrays["depth_m"] = image.depth_m
        np.savez(self._folder / f"{index}.npz", **arrays)
        opening_s, self._opening_s = self._opening_s, None
        return Taken(seconds, opening_s, self._renderer.describe())

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()


def shoot(
    case: Case, choice: ComponentChoice, folder: Path, executor: Executor, jobs: list[int]
) -> Iterator[FrameResult[Taken]]:
    """Render jobs of a case into a folder.

    Raises:
        WorkerSetupError: the renderer cannot be opened.
    """
    folder.mkdir(parents=True, exist_ok=True)
    return executor.run(partial(Shooter, case, choice, folder), jobs)


def load_shot(folder: Path, index: int, taken: Taken) -> Shot:
    """Read a job's picture back."""
    with np.load(folder / f"{index}.npz", allow_pickle=False) as arrays:
        return Shot(
            arrays["radiance_rgb"],
            arrays["coverage"],
            arrays.get("depth_m"),
            taken.seconds,
            taken.opening_s,
        )
