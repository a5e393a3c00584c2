"""All extension points of POSSE.

A plugin is an installed distribution with an entry point in the group ``posse`` whose object (a
module, usually) has functions marked with ``@posse_core.hookimpl``::

    # pyproject.toml
    [project.entry-points.posse]
    render_wire = "posse_render_wire"

    # posse_render_wire.py
    from posse_core import ComponentSpec, hookimpl

    @hookimpl
    def posse_renderers():
        return [ComponentSpec("wire", "wire frames", "posse_render_wire.wire:WireRenderer")]

Each kind of component (``posse_core/_plugins/kinds.py``) has a hook that returns a list of
:class:`~posse_core.ComponentSpec`. These hooks are called once, when plugins are loaded, so they must be
fast and must not import what the component needs. The observer hooks are called during a run, in the
process of the command line. An error in an observer is reported as a warning, and the run continues.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pluggy

from posse_core._plugins.registry import ComponentSpec

if TYPE_CHECKING:  # named in signatures alone
    from posse_core._model.label_line import LabelLine
    from posse_core._model.manifest import Manifest

hookspec = pluggy.HookspecMarker("posse")
hookimpl = pluggy.HookimplMarker("posse")


@hookspec
def posse_propagators() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Propagator`. Since 0.1."""


@hookspec
def posse_attitude_laws() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.AttitudeLaw`, which orient target and camera. Since 0.1."""


@hookspec
def posse_joint_laws() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.JointLaw`, which move joints of spacecraft. Since 0.1."""


@hookspec
def posse_scenes() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.SceneSource`, which make spacecraft. Since 0.1."""


@hookspec
def posse_renderers() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Renderer`. Since 0.1."""


@hookspec
def posse_annotators() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Annotator`. Since 0.1."""


@hookspec
def posse_sensors() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Sensor`, which take readings beside the camera. Since 0.1."""


@hookspec
def posse_detectors() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Model`. Since 0.1."""


@hookspec
def posse_refiners() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Refiner`, which refine poses. Since 0.1."""


@hookspec
def posse_navigators() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Navigator`, which estimate the relative motion. Since 0.1."""


@hookspec
def posse_controllers() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Controller`, which decide on impulses. Since 0.1."""


@hookspec
def posse_writers() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Writer`: dataset formats. Since 0.1."""


@hookspec
def posse_executors() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Classes of :class:`posse_core.Executor`, which make frames in workers. Since 0.1."""


@hookspec
def posse_subcommands() -> Sequence[ComponentSpec]:  # type: ignore[empty-body]
    """Commands of the command line; ``factory`` names a :class:`click.Command`. Since 0.1."""


@hookspec
def posse_run_started(dataset: Path, frames: int) -> None:
    """A run is about to make its first frame in the folder ``dataset``. Since 0.1.

    In a run to a network store, this is the local folder of its bookkeeping files.
    """


@hookspec
def posse_frame_completed(index: int, labels: LabelLine) -> None:
    """A frame's files are complete on disk; ``labels`` is its label line. Since 0.1."""


@hookspec
def posse_run_finished(dataset: Path, manifest: Manifest) -> None:
    """A run has ended and its manifest is written. Since 0.1."""
