"""The worker of a run, which writes the frames of the dataset's scenario as files."""

from __future__ import annotations

import contextlib
import hashlib
import json
import warnings
from collections.abc import Callable
from functools import partial

from posse_core._dataset.layout import IMAGES, INPUTS, SCENARIO, TRAJECTORY, TRUTH, reading_file
from posse_core._dataset.remarks import remark_on
from posse_core._files.compressed import npz, png
from posse_core._files.store import Store, open_store
from posse_core._files.trajectory import load_trajectory
from posse_core._interfaces.executor import FrameMade
from posse_core._model.reading import Reading
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._simulator.frame import Frame
from posse_core._simulator.simulator import Simulator
from posse_core._threads import in_threads

RENDERER_FILE = "renderer.json"
"""File with the renderer's description of itself, which becomes part of the manifest."""


class RunWorker:
    """Makes the frames of one dataset and writes their files."""

    def __init__(self, dataset: str) -> None:
        """Open a dataset at a path or URL, which must hold the scenario with its files, and the
        trajectory."""
        self._store = open_store(dataset)
        registry = load_plugins().registry
        with contextlib.ExitStack() as stack:
            # The copies of inputs are kept: components may read them at any time.
            scenario_file = stack.enter_context(self._store.local_copy(SCENARIO, INPUTS))
            scenario = load_scenario(str(scenario_file), registry)
            with self._store.local_copy(TRAJECTORY) as path:
                trajectory = load_trajectory(path)
            with warnings.catch_warnings():
                # The plan of the run has built the spacecraft before, and has warned of the user's file.
                warnings.filterwarnings("ignore", module=r"posse_core\._spacecraft\.")
                self._simulator = Simulator(scenario, registry, trajectory)
            stack.callback(self._simulator.close)
            write_renderer(self._simulator, self._store)
            self._opened = stack.pop_all()

    def make(self, index: int) -> FrameMade:
        """Make one frame and write its files."""
        return write_frame(self._simulator.frame(self._simulator.state(index)), self._store)

    def close(self) -> None:
        """Free the renderer, and delete local copies."""
        self._opened.close()


def write_renderer(simulator: Simulator, store: Store) -> None:
    """Write the renderer's description of itself."""
    described = json.dumps(dict(simulator.describe_renderer()), indent=2, ensure_ascii=False)
    store.write(RENDERER_FILE, f"{described}\n".encode())


def write_frame(frame: Frame, store: Store) -> FrameMade:
    """Write the files of a frame of a dataset."""
    image, truth = f"{IMAGES}/{frame.index:06d}.png", f"{TRUTH}/{frame.index:06d}.npz"
    files: dict[str, Callable[[], bytes]] = {image: partial(png, frame.image)}
    if frame.arrays:
        files[truth] = partial(npz, frame.arrays)
    labels = frame.labels.model_copy(update={"image": image, "truth": truth if frame.arrays else None})
    if frame.readings:
        beside = {}
        for name, readings in frame.readings.items():
            own = [_reading_files(reading, name, frame.index, k) for k, reading in enumerate(readings)]
            beside[name] = tuple(
                said.model_copy(update={"files": tuple(each)})
                for said, each in zip(labels.sensors[name], own, strict=True)
            )
            for each in own:
                files |= each
        labels = labels.model_copy(update={"sensors": beside})

    def write(name: str) -> str:
        data = files[name]()
        store.write(name, data)
        return hashlib.sha256(data).hexdigest()

    digests = dict(zip(files, in_threads(write, list(files)), strict=True))
    return FrameMade(labels, digests, remark_on(labels, frame.image))


def _reading_files(
    reading: Reading, sensor: str, index: int, number: int
) -> dict[str, Callable[[], bytes]]:
    """What makes the files of a reading, by their names in the dataset."""
    by_ending: dict[str, Callable[[], bytes]] = {
        ending: partial(bytes, data) for ending, data in reading.files.items()
    }
    if reading.image is not None:
        by_ending[".png"] = partial(png, reading.image)
    if reading.arrays:
        by_ending[".npz"] = partial(npz, reading.arrays)
    return {
        reading_file(sensor, index, number, ending): by_ending[ending] for ending in sorted(by_ending)
    }
