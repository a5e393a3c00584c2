"""The worker of a run, which writes the frames of the dataset's scenario as files."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.layout import IMAGES, SCENARIO, TRAJECTORY, TRUTH
from posse_core._errors import ComponentError
from posse_core._files.store import Store, open_store
from posse_core._files.trajectory import load_trajectory
from posse_core._interfaces.executor import FrameMade
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._simulator.frame import Frame
from posse_core._simulator.simulator import Simulator

RENDERER_FILE = "renderer.json"
"""File with the renderer's description of itself, which becomes part of the manifest."""


class RunWorker:
    """Makes the frames of one dataset and writes their files."""

    def __init__(self, dataset: str) -> None:
        """Open a dataset at a path or URL, which must hold the scenario and the trajectory."""
        self._store = open_store(dataset)
        registry = load_plugins().registry
        with self._store.local_copy(SCENARIO) as path:
            scenario = load_scenario(str(path), registry)
        with self._store.local_copy(TRAJECTORY) as path:
            trajectory = load_trajectory(path)
        self._simulator = Simulator(scenario, registry, trajectory)
        write_renderer(self._simulator, self._store)

    def make(self, index: int) -> FrameMade:
        """Make one frame and write its files."""
        return write_frame(self._simulator.frame(self._simulator.state(index)), self._store)

    def close(self) -> None:
        """Free the renderer."""
        self._simulator.close()


def write_renderer(simulator: Simulator, store: Store) -> None:
    """Write the renderer's description of itself."""
    described = json.dumps(dict(simulator.describe_renderer()), indent=2, ensure_ascii=False)
    store.write(RENDERER_FILE, f"{described}\n".encode())


def write_frame(frame: Frame, store: Store) -> FrameMade:
    """Write the files of a frame of a dataset."""
    image, truth = f"{IMAGES}/{frame.index:06d}.png", f"{TRUTH}/{frame.index:06d}.npz"
    files = {image: _png(frame.image)}
    if frame.arrays:
        files[truth] = _npz(frame.arrays)
    for name, data in files.items():
        store.write(name, data)
    labels = frame.labels.model_copy(update={"image": image, "truth": truth if frame.arrays else None})
    return FrameMade(labels, {name: hashlib.sha256(data).hexdigest() for name, data in files.items()})


def _png(image: AnyArray) -> bytes:
    colour = cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if image.ndim == 3 else image
    ok, data = cv2.imencode(".png", colour, [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not ok:
        raise ComponentError("the image could not be encoded as PNG")
    return bytes(data)


def _npz(arrays: Mapping[str, AnyArray]) -> bytes:
    """Return an .npz file whose bytes depend on the arrays alone; numpy's compression is slower."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, member.getvalue())
    return buffer.getvalue()
