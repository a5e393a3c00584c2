"""The kinds of component, in one table with everything that POSSE knows of each kind.

The table is read by loading, the registry, ``posse describe``, ``posse plugins``, ``posse doctor``, the
documentation and the conformance kit. It names classes by strings, which are imported when they are
first needed, so that listing what is installed is fast.
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
    """A capability that components of a kind may declare in their records.

    Attributes:
        claim: one line of documentation.
        interface: ``"module:Class"`` that such components must implement, if not just the kind's own.
    """

    claim: str
    interface: str = ""


@dataclass(frozen=True)
class Kind:
    """One kind of component.

    Attributes:
        name: as in ``posse describe renderer``.
        hook: the function by which a plugin returns its records of this kind.
        interface: ``"module:Class"``, of which a component's class is a subclass. The factory of a
            subcommand is an instance of it instead.
        summary: one line of documentation.
        conformance: ``"module:Class"`` of the tests that every component of the kind must pass.
        capabilities: the capabilities that a record may declare, by name.
    """

    name: str
    hook: str
    interface: str
    summary: str
    conformance: str
    capabilities: Mapping[str, Capability] = field(default_factory=dict)

    def unknown_capability(self, claimed: Iterable[str]) -> str | None:
        """Return a message about the first capability that this kind does not have, or None."""
        for word in sorted(set(claimed) - self.capabilities.keys()):
            known = ", ".join(self.capabilities) or "none"
            hint = nearest(word, self.capabilities)
            return f"a {self.name} has no capability {word!r}{hint} (known: {known})"
        return None

    def class_fault(self, found: object, claimed: Iterable[str] = ()) -> str | None:
        """Return why an object cannot be a component with these capabilities, or None."""
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
    """Import the object that ``"module:Name"`` names; errors of the import are passed on."""
    module_name, _, attribute = target.partition(":")
    return getattr(importlib.import_module(module_name), attribute)


def shown(target: str) -> str:
    """Return ``"module:Class"`` as Python writes it, ``module.Class``."""
    return target.replace(":", ".")


_KINDS = (
    Kind(
        "propagator",
        "posse_propagators",
        "posse_core:Propagator",
        "computes the motion of target and chaser",
        "posse_core.testing:PropagatorConformance",
        {
            "exact-two-body": Capability("agrees with Kepler motion to rounding"),
            "own-frames": Capability("its motion may have other times than the requested ones"),
        },
    ),
    Kind(
        "attitude-law",
        "posse_attitude_laws",
        "posse_core:AttitudeLaw",
        "orients the target or the camera",
        "posse_core.testing:AttitudeLawConformance",
        {
            "target": Capability("can orient the target"),
            "camera": Capability("can orient the camera"),
        },
    ),
    Kind(
        "joint-law",
        "posse_joint_laws",
        "posse_core:JointLaw",
        "moves a joint of a spacecraft",
        "posse_core.testing:JointLawConformance",
    ),
    Kind(
        "scene",
        "posse_scenes",
        "posse_core:SceneSource",
        "makes a spacecraft",
        "posse_core.testing:SceneSourceConformance",
    ),
    Kind(
        "renderer",
        "posse_renderers",
        "posse_core:Renderer",
        "computes the radiance of the spacecraft",
        "posse_core.testing:RendererConformance",
        {
            "path-traced": Capability("includes all reflections between parts"),
            "deterministic": Capability("the same request gives images equal to the bit"),
            "environment": Capability("the environment map lights the spacecraft"),
            "depth": Capability("returns the depth of each pixel too"),
            "gpu": Capability("uses a GPU if there is one"),
        },
    ),
    Kind(
        "annotator",
        "posse_annotators",
        "posse_core:Annotator",
        "makes labels from exact geometry",
        "posse_core.testing:AnnotatorConformance",
    ),
    Kind(
        "sensor",
        "posse_sensors",
        "posse_core:Sensor",
        "takes readings beside the chaser's camera",
        "posse_core.testing:SensorConformance",
    ),
    Kind(
        "detector",
        "posse_detectors",
        "posse_core:Model",
        "finds spacecraft, or their keypoints, in images",
        "posse_core.testing:DetectorConformance",
        {
            "boxes": Capability("finds boxes", "posse_core:Detector"),
            "keypoints": Capability("finds keypoints in a box", "posse_core:KeypointFinder"),
            "train": Capability("can be trained on a dataset"),
            "onnx": Capability("can be exported to ONNX"),
            "int8": Capability("can also be exported to 8-bit ONNX"),
            ".onnx": Capability("reads ONNX files"),
            "shipped": Capability("its plugin ships a trained model"),
        },
    ),
    Kind(
        "refiner",
        "posse_refiners",
        "posse_core:Refiner",
        "brings the pose of a known spacecraft closer to what an image shows",
        "posse_core.testing:RefinerConformance",
    ),
    Kind(
        "navigator",
        "posse_navigators",
        "posse_core:Navigator",
        "estimates the relative motion from the chaser's readings",
        "posse_core.testing:NavigatorConformance",
        {"truth": Capability("gets the true state beside the readings")},
    ),
    Kind(
        "controller",
        "posse_controllers",
        "posse_core:Controller",
        "decides on the chaser's impulses",
        "posse_core.testing:ControllerConformance",
        {"no-waypoints": Capability("needs no goal")},
    ),
    Kind(
        "writer",
        "posse_writers",
        "posse_core:Writer",
        "exports a dataset to a format that other tools read",
        "posse_core.testing:WriterConformance",
        {
            "pinhole-only": Capability("the format cannot describe lens distortion"),
            "no-rational-lens": Capability("the format cannot describe OpenCV's rational lens model"),
            "global-shutter-only": Capability("the format cannot describe a rolling shutter"),
            "no-joints": Capability("the format cannot describe a spacecraft whose joints move"),
            "labels-only": Capability(
                "reads neither images nor arrays, so a run to a network store can use it"
            ),
        },
    ),
    Kind(
        "executor",
        "posse_executors",
        "posse_core:Executor",
        "distributes the frames of a run over workers",
        "posse_core.testing:ExecutorConformance",
    ),
    Kind(
        "subcommand",
        "posse_subcommands",
        "click:Command",
        "a command of the command line",
        "posse_core.testing:CommandConformance",
    ),
)

KINDS: Final[Mapping[str, Kind]] = {kind.name: kind for kind in _KINDS}
"""All kinds by name."""

RESERVED: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "posse-detect-onnx": {"plugin": ("detect_onnx",), "detector": ("onnx", "onnx-keypoints")},
    "posse-detect-torch": {"plugin": ("detect_torch",), "detector": ("heatmap", "nano", "sdn")},
    "posse-executor-ray": {"plugin": ("executor_ray",), "executor": ("ray",)},
    "posse-render-blender": {"plugin": ("render_blender",), "renderer": ("blender",)},
    "posse-render-mitsuba": {"plugin": ("render_mitsuba",), "renderer": ("mitsuba",)},
    "posse-render-raster": {"plugin": ("render_raster",), "renderer": ("raster",)},
}
"""Official distribution → the names reserved for it, of its plugin and of its components by kind.
The built-in components need no entry, since the core is loaded before all plugins."""


def reserved_for(kind: str, name: str) -> str | None:
    """Return the official distribution that a component's (or a "plugin"'s) name is reserved for."""
    for distribution, names in RESERVED.items():
        if name in names.get(kind, ()):
            return distribution
    return None
