"""The manifest of a dataset: what it was made from, and whether it is complete."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib import metadata

from posse_core import __version__
from posse_core._dataset.layout import (
    BODIES,
    CAMERA,
    FLIGHT,
    INPUTS,
    LABELS,
    READINGS,
    SCENARIO,
    SENSORS,
    SPACECRAFT,
    TRAJECTORY,
)
from posse_core._files.atomic import sha256
from posse_core._files.reading import parsed_json
from posse_core._model.manifest import CHECKSUMS, FORMAT, FORMAT_VERSION, Manifest, PluginVersion
from posse_core._plugins.loading import Plugins
from posse_core._run.destination import Destination
from posse_core._run.worker import RENDERER_FILE
from posse_core._scenario.model import Scenario

_LIBRARIES = ("casadi", "embreex", "numpy", "opencv-contrib-python-headless", "scipy")


def make_manifest(
    destination: Destination,
    scenario: Scenario,
    frames: int,
    plugins: Plugins,
    failed: Mapping[int, str],
    exports: Mapping[str, str],
) -> Manifest:
    """Make the manifest of a run that has ended.

    Args:
        destination: holds the dataset's files.
        scenario: that the dataset was made from.
        frames: number of frames that it should have.
        plugins: whose versions are recorded.
        failed: index of a frame → its error.
        exports: name of a file that a writer wrote → its SHA-256.
    """
    folder = destination.folder
    try:
        renderer = parsed_json(destination.store.read(RENDERER_FILE), RENDERER_FILE)
    except FileNotFoundError:
        renderer = {}
    hashed = sorted(
        path
        for pattern in (
            *(SCENARIO, TRAJECTORY, CAMERA, FLIGHT, READINGS),
            *(f"{INPUTS}/**/*", f"{SPACECRAFT}/*", f"{BODIES}/*/*", f"{SENSORS}/*.json"),
            f"{LABELS}/*",
        )
        for path in folder.glob(pattern)
        if path.is_file()
    )
    return Manifest(
        format=FORMAT,
        format_version=FORMAT_VERSION,
        state="incomplete" if failed else "complete",
        frames=frames,
        failed_frames=dict(sorted(failed.items())),
        seed=scenario.seed,
        renderer={"name": scenario.renderer.name, **renderer},
        versions={
            "posse-core": __version__,
            "python": platform.python_version(),
            **{name: metadata.version(name) for name in _LIBRARIES},
        },
        plugins={
            status.name: PluginVersion(dist=status.dist, version=status.version, state=status.state)
            for status in plugins.statuses
        },
        sha256={path.relative_to(folder).as_posix(): sha256(path) for path in hashed},
        exports=dict(exports),
        frame_checksums=CHECKSUMS,
    )
