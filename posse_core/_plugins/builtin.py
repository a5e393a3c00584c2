"""The core's own components, registered through the same hooks as a third party's."""

from __future__ import annotations

from posse_core._plugins.hooks import hookimpl
from posse_core._plugins.registry import ComponentSpec


@hookimpl
def posse_propagators() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "file",
            "a trajectory computed elsewhere: NPZ, CSV, or CCSDS OEM; its own frames",
            "posse_core._propagators.file:FilePropagator",
            options="posse_core._propagators.options:FileOptions",
            capabilities=frozenset({"own-frames"}),
        ),
        ComponentSpec(
            "hcw",
            "Hill-Clohessy-Wiltshire: circular target, small separation",
            "posse_core._propagators.linear:HcwPropagator",
        ),
        ComponentSpec(
            "j2-roe",
            "relative orbital elements under J2 in closed form (Koenig-Guffanti-D'Amico)",
            "posse_core._propagators.j2_roe:J2RoePropagator",
            options="posse_core._propagators.options:J2RoeOptions",
        ),
        ComponentSpec(
            "nonlinear",
            "integrated: two-body or J2, drag, solar pressure, Sun and Moon; the reference",
            "posse_core._propagators.nonlinear:NonlinearPropagator",
            options="posse_core._propagators.options:NonlinearOptions",
        ),
        ComponentSpec(
            "roe",
            "exact two-body relative motion from relative orbital elements (the default)",
            "posse_core._propagators.roe:RoePropagator",
            capabilities=frozenset({"exact-two-body"}),
        ),
        ComponentSpec(
            "roe-near-circular",
            "relative orbital elements mapped by T(u): near-circular target",
            "posse_core._propagators.linear:NearCircularPropagator",
        ),
        ComponentSpec(
            "sgp4",
            "target and chaser by SGP4 from a TLE",
            "posse_core._propagators.sgp4:Sgp4Propagator",
        ),
        ComponentSpec(
            "thesis",
            "the thesis' own propagation, literally: N instances x H relative orbits",
            "posse_core._propagators.thesis:ThesisPropagator",
            options="posse_core._propagators.options:ThesisOptions",
            capabilities=frozenset({"own-frames"}),
        ),
        ComponentSpec(
            "yamanaka-ankersen",
            "Yamanaka-Ankersen: any eccentricity, small separation",
            "posse_core._propagators.linear:YamanakaAnkersenPropagator",
        ),
    ]


@hookimpl
def posse_scenes() -> list[ComponentSpec]:
    place = "posse_core._spacecraft"
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
            "posse_core._annotators.exact:BoxAnnotator",
        ),
        ComponentSpec("depth", "planar depth by pixel", "posse_core._annotators.exact:DepthAnnotator"),
        ComponentSpec(
            "keypoints",
            "keypoints with visibility: 0 out of frame, 1 occluded, 2 visible",
            "posse_core._annotators.exact:KeypointsAnnotator",
        ),
        ComponentSpec(
            "mask",
            "the mask as COCO run-lengths; its area, visible and lit fraction",
            "posse_core._annotators.exact:MaskAnnotator",
        ),
        ComponentSpec(
            "normals",
            "geometric normal by pixel, camera axes",
            "posse_core._annotators.exact:NormalsAnnotator",
        ),
        ComponentSpec(
            "parts",
            "part by pixel, and the visible area of each",
            "posse_core._annotators.exact:PartsAnnotator",
        ),
        ComponentSpec(
            "pose",
            "attitude, position, range, phase angle, direction of the Sun",
            "posse_core._annotators.exact:PoseAnnotator",
        ),
    ]


_LABELS_ONLY = frozenset({"labels-only"})


@hookimpl
def posse_writers() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "bop",
            "models, depth, masks and poses in mm",
            "posse_core._formats.bop:BopWriter",
            capabilities=frozenset({"pinhole-only"}),
        ),
        ComponentSpec(
            "coco",
            "boxes, masks and keypoints",
            "posse_core._formats.coco:CocoWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "posse",
            "the thesis' own four files",
            "posse_core._formats.thesis:ThesisWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "speed",
            "poses as in SPEED and SPEED+",
            "posse_core._formats.speed:SpeedWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "yolo", "boxes and keypoints for YOLO-pose", "posse_core._formats.yolo:YoloWriter"
        ),
    ]


@hookimpl
def posse_executors() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "local",
            "worker processes on this machine",
            "posse_core._run.local:LocalExecutor",
            "posse_core._run.attempts:PoolOptions",
        ),
    ]


@hookimpl
def posse_subcommands() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "collect", "join datasets, drop frames by rules", "posse_core._cli.collect:command"
        ),
        ComponentSpec(
            "crosscheck",
            "renderers held against geometry and each other",
            "posse_core._cli.crosscheck:command",
        ),
        ComponentSpec(
            "describe", "keys of a scenario, options of a component", "posse_core._cli.describe:command"
        ),
        ComponentSpec("detect", "find spacecraft in images", "posse_core._cli.detect:command"),
        ComponentSpec(
            "doctor", "what works on this machine, and how to mend it", "posse_core._cli.doctor:command"
        ),
        ComponentSpec("eval", "how right a detector is", "posse_core._cli.eval:command"),
        ComponentSpec("export", "the labels in another format", "posse_core._cli.export:command"),
        ComponentSpec(
            "export-onnx", "a trained net as ONNX, checked", "posse_core._cli.export_onnx:command"
        ),
        ComponentSpec(
            "import", "a spacecraft package from a mesh", "posse_core._cli.import_mesh:command"
        ),
        ComponentSpec(
            "import-poses",
            "a scenario from the labels of another dataset",
            "posse_core._cli.import_poses:command",
        ),
        ComponentSpec(
            "manoeuvres", "impulses of a scenario's plan", "posse_core._cli.manoeuvres:command"
        ),
        ComponentSpec(
            "model-errors",
            "how far each model of relative motion is off",
            "posse_core._cli.model_errors:command",
        ),
        ComponentSpec("partition", "train, valid and test lists", "posse_core._cli.partition:command"),
        ComponentSpec(
            "plugins", "what is installed, and what became of it", "posse_core._cli.plugins:command"
        ),
        ComponentSpec(
            "propagate", "the trajectory of a scenario, alone", "posse_core._cli.propagate:command"
        ),
        ComponentSpec("run", "scenario to labelled dataset", "posse_core._cli.run:command"),
        ComponentSpec("train", "a detector learns from a dataset", "posse_core._cli.train:command"),
        ComponentSpec("validate", "prove the labels", "posse_core._cli.validate:command"),
        ComponentSpec("view", "a page to look at a dataset with", "posse_core._cli.view:command"),
    ]
