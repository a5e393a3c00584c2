"""The core's own components, registered through the same hooks as a third party's."""

from __future__ import annotations

from posse_core.hookspecs import hookimpl
from posse_core.registry import ComponentSpec


@hookimpl
def posse_propagators() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "file",
            "a trajectory computed elsewhere: NPZ, CSV, or CCSDS OEM; its own frames",
            "posse_core.propagators.file:FilePropagator",
            options="posse_core.propagators.options:FileOptions",
            capabilities=frozenset({"own-frames"}),
        ),
        ComponentSpec(
            "hcw",
            "Hill-Clohessy-Wiltshire: circular target, small separation",
            "posse_core.propagators.linear:HcwPropagator",
        ),
        ComponentSpec(
            "j2-roe",
            "relative orbital elements under J2 in closed form (Koenig-Guffanti-D'Amico)",
            "posse_core.propagators.j2_roe:J2RoePropagator",
            options="posse_core.propagators.options:J2RoeOptions",
        ),
        ComponentSpec(
            "nonlinear",
            "integrated: two-body or J2, drag, solar pressure, Sun and Moon; the reference",
            "posse_core.propagators.nonlinear:NonlinearPropagator",
            options="posse_core.propagators.options:NonlinearOptions",
        ),
        ComponentSpec(
            "roe",
            "exact two-body relative motion from relative orbital elements (the default)",
            "posse_core.propagators.roe:RoePropagator",
            capabilities=frozenset({"exact-two-body"}),
        ),
        ComponentSpec(
            "roe-near-circular",
            "relative orbital elements mapped by T(u): near-circular target",
            "posse_core.propagators.linear:NearCircularPropagator",
        ),
        ComponentSpec(
            "sgp4",
            "target and chaser by SGP4 from a TLE",
            "posse_core.propagators.sgp4:Sgp4Propagator",
        ),
        ComponentSpec(
            "thesis",
            "the thesis' own propagation, literally: N instances x H relative orbits",
            "posse_core.propagators.thesis:ThesisPropagator",
            options="posse_core.propagators.options:ThesisOptions",
            capabilities=frozenset({"own-frames"}),
        ),
        ComponentSpec(
            "yamanaka-ankersen",
            "Yamanaka-Ankersen: any eccentricity, small separation",
            "posse_core.propagators.linear:YamanakaAnkersenPropagator",
        ),
    ]


@hookimpl
def posse_scenes() -> list[ComponentSpec]:
    place = "posse_core.spacecraft"
    return [
        ComponentSpec(
            "aqua",
            "Aqua-like: a bus with one long solar wing, 8.0 × 16.7 × 4.8 m",
            f"{place}.aqua:Aqua",
            f"{place}.options:AquaOptions",
        ),
        ComponentSpec(
            "cluster",
            "Cluster-like: a spinning drum 2.9 m across with two 5 m booms",
            f"{place}.cluster:Cluster",
            f"{place}.options:ClusterOptions",
        ),
        ComponentSpec(
            "cubesat",
            "a 3U CubeSat with two wings, 10 × 10 × 34 cm",
            f"{place}.cubesat:Cubesat",
            f"{place}.cubesat:CubesatOptions",
        ),
        ComponentSpec(
            "mesh",
            "a mesh file of your own: glTF, OBJ, PLY, STL",
            f"{place}.mesh:MeshFile",
            f"{place}.options:MeshOptions",
        ),
        ComponentSpec(
            "package",
            "a spacecraft package made by 'posse import'",
            f"{place}.package:Package",
            f"{place}.options:PackageOptions",
        ),
    ]


@hookimpl
def posse_annotators() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "box",
            "tight box of the visible pixels, and the box of all vertices",
            "posse_core.annotators.exact:BoxAnnotator",
        ),
        ComponentSpec("depth", "planar depth by pixel", "posse_core.annotators.exact:DepthAnnotator"),
        ComponentSpec(
            "keypoints",
            "keypoints with visibility: 0 out of frame, 1 occluded, 2 visible",
            "posse_core.annotators.exact:KeypointsAnnotator",
        ),
        ComponentSpec(
            "mask",
            "the mask as COCO run-lengths; its area, visible and lit fraction",
            "posse_core.annotators.exact:MaskAnnotator",
        ),
        ComponentSpec(
            "normals",
            "geometric normal by pixel, camera axes",
            "posse_core.annotators.exact:NormalsAnnotator",
        ),
        ComponentSpec(
            "parts",
            "part by pixel, and the visible area of each",
            "posse_core.annotators.exact:PartsAnnotator",
        ),
        ComponentSpec(
            "pose",
            "attitude, position, range, phase angle, direction of the Sun",
            "posse_core.annotators.exact:PoseAnnotator",
        ),
    ]


_LABELS_ONLY = frozenset({"labels-only"})


@hookimpl
def posse_writers() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "bop",
            "models, depth, masks and poses in mm",
            "posse_core.formats.bop:BopWriter",
            capabilities=frozenset({"pinhole-only"}),
        ),
        ComponentSpec(
            "coco",
            "boxes, masks and keypoints",
            "posse_core.formats.coco:CocoWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "posse",
            "the thesis' own four files",
            "posse_core.formats.thesis:ThesisWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "speed",
            "poses as in SPEED and SPEED+",
            "posse_core.formats.speed:SpeedWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec("yolo", "boxes and keypoints for YOLO-pose", "posse_core.formats.yolo:YoloWriter"),
    ]


@hookimpl
def posse_executors() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "local",
            "worker processes on this machine",
            "posse_core.pipeline.local:LocalExecutor",
            "posse_core.pipeline.attempts:PoolOptions",
        ),
    ]


@hookimpl
def posse_subcommands() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "collect", "join datasets, drop frames by rules", "posse_core.cli.collect:command"
        ),
        ComponentSpec(
            "crosscheck",
            "renderers held against geometry and each other",
            "posse_core.cli.crosscheck:command",
        ),
        ComponentSpec(
            "describe", "keys of a scenario, options of a component", "posse_core.cli.describe:command"
        ),
        ComponentSpec("detect", "find spacecraft in images", "posse_core.cli.detect:command"),
        ComponentSpec(
            "doctor", "what works on this machine, and how to mend it", "posse_core.cli.doctor:command"
        ),
        ComponentSpec("eval", "how right a detector is", "posse_core.cli.eval:command"),
        ComponentSpec("export", "the labels in another format", "posse_core.cli.export:command"),
        ComponentSpec(
            "export-onnx", "a trained net as ONNX, checked", "posse_core.cli.export_onnx:command"
        ),
        ComponentSpec(
            "import", "a spacecraft package from a mesh", "posse_core.cli.import_mesh:command"
        ),
        ComponentSpec(
            "import-poses",
            "a scenario from the labels of another dataset",
            "posse_core.cli.import_poses:command",
        ),
        ComponentSpec(
            "manoeuvres", "impulses of a scenario's plan", "posse_core.cli.manoeuvres:command"
        ),
        ComponentSpec(
            "model-errors",
            "how far each model of relative motion is off",
            "posse_core.cli.model_errors:command",
        ),
        ComponentSpec("partition", "train, valid and test lists", "posse_core.cli.partition:command"),
        ComponentSpec(
            "plugins", "what is installed, and what became of it", "posse_core.cli.plugins:command"
        ),
        ComponentSpec(
            "propagate", "the trajectory of a scenario, alone", "posse_core.cli.propagate:command"
        ),
        ComponentSpec("run", "scenario to labelled dataset", "posse_core.cli.run:command"),
        ComponentSpec("train", "a detector learns from a dataset", "posse_core.cli.train:command"),
        ComponentSpec("validate", "prove the labels", "posse_core.cli.validate:command"),
        ComponentSpec("view", "a page to look at a dataset with", "posse_core.cli.view:command"),
    ]
