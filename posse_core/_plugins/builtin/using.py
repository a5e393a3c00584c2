"""The core's refiners, writers, executors and subcommands."""

from __future__ import annotations

from posse_core._plugins.hooks import hookimpl
from posse_core._plugins.registry import ComponentSpec

_LABELS_ONLY = frozenset({"labels-only"})
_STATIC_WORLD = frozenset({"global-shutter-only", "no-joints"})
_NO_RATIONAL_LENS = frozenset({"no-rational-lens"})


@hookimpl
def posse_refiners() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "render-compare",
            "draws what would be seen, compares, and corrects the pose; finds the light itself",
            "posse_core._refinement.render_compare:RenderCompare",
            "posse_core._refinement.options:RenderCompareOptions",
        ),
    ]


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
            "colmap",
            "a COLMAP model of each target: poses, sparse points with tracks, masks",
            "posse_core._formats.colmap:ColmapWriter",
            capabilities=_STATIC_WORLD,
        ),
        ComponentSpec(
            "hf",
            "a folder for Hugging Face's datasets: images, labels, splits, card, Croissant",
            "posse_core._formats.hf:HfWriter",
            "posse_core._formats.hf:HfOptions",
        ),
        ComponentSpec(
            "kalibr",
            "intrinsics and extrinsics of all cameras as a Kalibr camchain",
            "posse_core._formats.kalibr:KalibrWriter",
            capabilities=_LABELS_ONLY | _NO_RATIONAL_LENS,
        ),
        ComponentSpec(
            "nerfstudio",
            "transforms.json of each target: poses, sparse points, masks",
            "posse_core._formats.nerfstudio:NerfstudioWriter",
            capabilities=_STATIC_WORLD | _NO_RATIONAL_LENS,
        ),
        ComponentSpec(
            "opencv-calibration",
            "intrinsics and stereo pairs of all cameras as OpenCV's FileStorage",
            "posse_core._formats.opencv_calibration:OpencvCalibrationWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "posse",
            "the four files of the thesis",
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
            "adapt", "carry a recipe's nets on in another domain", "posse_core._cli.adapt:command"
        ),
        ComponentSpec(
            "annotate", "label your own photographs with poses", "posse_core._cli.annotate:command"
        ),
        ComponentSpec(
            "collect", "join datasets and drop frames by rules", "posse_core._cli.collect:command"
        ),
        ComponentSpec(
            "completion",
            "let bash, zsh or fish complete commands, names, keys and values",
            "posse_core._cli.completion:command",
        ),
        ComponentSpec(
            "crosscheck",
            "compare renderers with exact geometry and with each other",
            "posse_core._cli.crosscheck:command",
        ),
        ComponentSpec(
            "describe",
            "list keys of a scenario and options of a component",
            "posse_core._cli.describe:command",
        ),
        ComponentSpec("detect", "find spacecraft in images", "posse_core._cli.detect:command"),
        ComponentSpec(
            "doctor",
            "check what works on this machine, and how to fix it",
            "posse_core._cli.doctor:command",
        ),
        ComponentSpec("eval", "measure the accuracy of a detector", "posse_core._cli.eval:command"),
        ComponentSpec("export", "export the labels to another format", "posse_core._cli.export:command"),
        ComponentSpec(
            "export-onnx",
            "export a trained model to ONNX and check it",
            "posse_core._cli.export_onnx:command",
        ),
        ComponentSpec(
            "fly", "fly a scenario with the camera in the loop", "posse_core._cli.fly:command"
        ),
        ComponentSpec(
            "import", "make a spacecraft package from a mesh", "posse_core._cli.import_mesh:command"
        ),
        ComponentSpec(
            "import-poses",
            "make a scenario from the labels of another dataset",
            "posse_core._cli.import_poses:command",
        ),
        ComponentSpec(
            "manoeuvres", "list the impulses of a scenario's plan", "posse_core._cli.manoeuvres:command"
        ),
        ComponentSpec(
            "model-errors",
            "compute the errors of the models of relative motion",
            "posse_core._cli.model_errors:command",
        ),
        ComponentSpec(
            "partition",
            "divide a dataset into train, valid and test",
            "posse_core._cli.partition:command",
        ),
        ComponentSpec(
            "plugins", "list installed plugins and their state", "posse_core._cli.plugins:command"
        ),
        ComponentSpec(
            "preview", "show one frame of a scenario before a run", "posse_core._cli.preview:command"
        ),
        ComponentSpec(
            "propagate", "compute the trajectory of a scenario", "posse_core._cli.propagate:command"
        ),
        ComponentSpec(
            "recipe", "make nets for the pose of one spacecraft", "posse_core._cli.recipe:command"
        ),
        ComponentSpec("run", "make a labelled dataset from a scenario", "posse_core._cli.run:command"),
        ComponentSpec(
            "track", "track the target over a dataset's frames", "posse_core._cli.track:command"
        ),
        ComponentSpec("train", "train a detector on a dataset", "posse_core._cli.train:command"),
        ComponentSpec("validate", "check the labels of a dataset", "posse_core._cli.validate:command"),
        ComponentSpec(
            "version", "print the versions of POSSE and its plugins", "posse_core._cli.version:command"
        ),
        ComponentSpec("view", "write an HTML page that shows a dataset", "posse_core._cli.view:command"),
    ]
