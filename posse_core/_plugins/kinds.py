"""The kinds of component: all that POSSE knows of each kind stands in one table.

Loading, the registry, ``posse describe``, ``posse plugins``, ``posse doctor``, the documentation and the
conformance kit read it. Classes are named by strings and imported when they are first needed, so that
listing what is installed stays cheap.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from posse_core._plugins.options import nearest


@dataclass(frozen=True)
class Capability:
    """What a component of a kind may claim in its record.

    Attributes:
        claim: one line of documentation.
        interface: ``"module:Class"`` that the claim asks for, where the kind's own is not enough.
    """

    claim: str
    interface: str = ""


@dataclass(frozen=True)
class Kind:
    """One kind of component.

    Attributes:
        name: as in ``posse describe renderer``.
        hook: the function by which a plugin hands in its records of this kind.
        interface: ``"module:Class"``; a component's class is a subclass of it. A subcommand's
            factory is an instance of it instead.
        summary: one line of documentation.
        capabilities: what a record may claim, by word.
        conformance: ``"module:Class"`` of the tests that every component of the kind must pass.
    """

    name: str
    hook: str
    interface: str
    summary: str
    capabilities: Mapping[str, Capability] = field(default_factory=dict)
    conformance: str | None = None

    def unknown_capability(self, claimed: Iterable[str]) -> str | None:
        """What is wrong with the first claim that this kind does not have, or None."""
        for word in sorted(set(claimed) - self.capabilities.keys()):
            known = ", ".join(self.capabilities) or "none"
            hint = nearest(word, self.capabilities)
            return f"a {self.name} has no capability {word!r}{hint} (known: {known})"
        return None

    def class_fault(self, found: object, claimed: Iterable[str] = ()) -> str | None:
        """Why what a record's factory names cannot be a component with these capabilities, or None."""
        demands = {self.interface: ""}
        for word in sorted(claimed):
            demands.setdefault(self.capabilities[word].interface or self.interface, word)
        for target, word in demands.items():
            interface = import_target(target)
            why = f", which the capability {word!r} asks for" if word else ""
            if self.name == "subcommand":
                if not isinstance(found, interface):
                    return f"is not an instance of {shown(target)}{why}"
            elif not (isinstance(found, type) and issubclass(found, interface)):
                return f"is not a subclass of {shown(target)}{why}"
        if inspect.isabstract(found):
            missing = ", ".join(sorted(getattr(found, "__abstractmethods__", ())))
            return f"lacks methods of {shown(self.interface)}: {missing}"
        return None


def import_target(target: str) -> Any:
    """What ``"module:Name"`` names; whatever its import raises."""
    module_name, _, attribute = target.partition(":")
    return getattr(importlib.import_module(module_name), attribute)


def shown(target: str) -> str:
    """``"module:Class"`` as Python names it."""
    return target.replace(":", ".")


_KINDS = (
    Kind(
        "propagator",
        "posse_propagators",
        "posse_core:Propagator",
        "computes the motion of target and chaser",
        {
            "exact-two-body": Capability("agrees with Kepler motion to rounding"),
            "own-frames": Capability("its motion may have other times than those asked for"),
        },
        "posse_core.testing:PropagatorConformance",
    ),
    Kind(
        "scene",
        "posse_scenes",
        "posse_core:SceneSource",
        "makes a spacecraft",
    ),
    Kind(
        "renderer",
        "posse_renderers",
        "posse_core:Renderer",
        "makes the light that comes from the spacecraft",
        {
            "path-traced": Capability("light is reflected between parts as often as it is in nature"),
            "deterministic": Capability("the same request gives the same bits"),
            "environment": Capability("the environment map lights the spacecraft"),
            "depth": Capability("gives the depth of each pixel too"),
            "gpu": Capability("works on a graphics card where there is one"),
        },
        "posse_core.testing:RendererConformance",
    ),
    Kind(
        "annotator",
        "posse_annotators",
        "posse_core:Annotator",
        "makes labels from exact geometry",
    ),
    Kind(
        "detector",
        "posse_detectors",
        "posse_core:Model",
        "finds spacecraft, or their keypoints, in images",
        {
            "boxes": Capability("finds boxes", "posse_core:Detector"),
            "keypoints": Capability("finds keypoints in a box", "posse_core:KeypointFinder"),
            "train": Capability("can be trained on a dataset"),
            "onnx": Capability("can be exported as ONNX"),
            "int8": Capability("can be exported in eight bits too"),
            ".onnx": Capability("reads ONNX files"),
            "shipped": Capability("a trained model comes with it"),
        },
    ),
    Kind(
        "writer",
        "posse_writers",
        "posse_core:Writer",
        "exports a dataset to a format that other tools read",
        {
            "pinhole-only": Capability("the format cannot describe a lens that distorts"),
            "labels-only": Capability(
                "reads neither images nor arrays, so a run to a network store can use it"
            ),
        },
    ),
    Kind(
        "executor",
        "posse_executors",
        "posse_core:Executor",
        "spreads the frames of a run over workers",
    ),
    Kind(
        "subcommand",
        "posse_subcommands",
        "click:Command",
        "a command of the command line",
    ),
)

KINDS: Final[Mapping[str, Kind]] = {kind.name: kind for kind in _KINDS}
"""Every kind, by its name."""

RESERVED: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "posse-detect-onnx": {"plugin": ("detect_onnx",), "detector": ("onnx", "onnx-keypoints")},
    "posse-detect-torch": {"plugin": ("detect_torch",), "detector": ("nano", "sdn", "simcc")},
    "posse-executor-ray": {"plugin": ("executor_ray",), "executor": ("ray",)},
    "posse-render-blender": {"plugin": ("render_blender",), "renderer": ("blender",)},
    "posse-render-mitsuba": {"plugin": ("render_mitsuba",), "renderer": ("mitsuba",)},
    "posse-render-raster": {"plugin": ("render_raster",), "renderer": ("raster",)},
}
"""Official distribution → the names that it alone may have: its plugin's, and its components' by kind.
The core's own names need no entry, since the core is loaded before every plugin."""


def reserved_for(kind: str, name: str) -> str | None:
    """The official distribution that alone may have a component (or a "plugin") of this name."""
    for distribution, names in RESERVED.items():
        if name in names.get(kind, ()):
            return distribution
    return None
