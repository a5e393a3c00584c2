"""Measures the time from image to pose with ONNX models on the CPU, and the models' size.

    python benchmarks/detectors.py --threads 2

Boxes by 'nano', keypoints by 'heatmap', the pose by PnP from known points, as 'posse detect' does it;
each stage is timed by itself, and all together. Weights are as drawn: time does not depend on them. With
--sdn the thesis' net is timed too.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import onnxruntime
import torch
from torch import nn

from posse_core._detection.card import ModelCard, Task
from posse_core._detection.models import open_detector, open_keypoint_finder
from posse_core._detection.pnp import solve_pose
from posse_core._frames import matrix_from_rotation_vector
from posse_core._interfaces.detector import Detection, Detector
from posse_core._model.camera import Camera
from posse_core._plugins.loading import load_plugins
from posse_detect_torch import box_detector, heatmap, heatmap_finder, nano, sdn
from posse_detect_torch.export import export
from posse_detect_torch.regions_onnx import ONNX_TRANSLATIONS

CLASSES = ("aqua", "cluster")
POINTS = 11


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=30)
    parser.add_argument("--image", type=int, nargs=2, default=(1280, 960), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--nano-px", type=int, nargs="+", default=(320, 416))
    parser.add_argument(
        "--sdn", action="store_true", help="SDN-18 at 640 px too; exporting takes a minute"
    )
    options = parser.parse_args()
    print(f"onnxruntime {onnxruntime.__version__}, {options.threads} threads, image {options.image}")
    with tempfile.TemporaryDirectory() as folder:
        _run(options, Path(folder))


def _run(options: argparse.Namespace, folder: Path) -> None:
    registry, threads = load_plugins().registry, {"threads": options.threads}
    random = np.random.default_rng(0)
    width, height = options.image
    image = random.integers(0, 60, (height, width), dtype=np.uint8)
    camera = Camera(width, height, width, width, (width - 1) / 2, (height - 1) / 2, 0.036)
    box = Detection("aqua", 1.0, np.array([width * 0.3, height * 0.3, height * 0.4, height * 0.3]))

    net = heatmap.HeatMaps(POINTS * len(CLASSES))
    keypoints, points_count = folder / "heatmap.onnx", _count(net)
    _write(heatmap.Decoded(net), heatmap_finder.OUTPUTS, "heatmap", "keypoints", 256, keypoints)
    finder = open_keypoint_finder(keypoints, registry, threads)
    find = _ms(lambda: finder.find(image, [box]), options.repeats)

    body_m = random.uniform(-3, 3, (POINTS, 3))
    R = matrix_from_rotation_vector(np.array([0.3, -0.5, 0.8]))
    pixels = camera.project(body_m @ R.T + [0.2, -0.1, 20.0]) + random.normal(0, 1, (POINTS, 2))
    sigma_px = np.ones(POINTS)
    pose = _ms(lambda: solve_pose(body_m, pixels, sigma_px, camera), options.repeats)
    print(f"heatmap 256 px: {points_count / 1e6:.2f} M parameters, {find} a craft")
    print(f"pose of {POINTS} points: {pose}")

    for size in options.nano_px:
        light = nano.Nano(len(CLASSES))
        path = folder / f"nano-{size}.onnx"
        _write(nano.Decoded(light, 16), box_detector.OUTPUTS, "nano", "boxes", size, path)
        detector = open_detector(path, registry, threads)
        box_time = _ms(partial(detector.predict, [image]), options.repeats)

        def whole(detector: Detector = detector) -> None:
            detector.predict([image])
            finder.find(image, [box])
            solve_pose(body_m, pixels, sigma_px, camera)

        all_time = _ms(whole, options.repeats)
        million = (_count(light) + points_count) / 1e6
        print(f"nano {size} px: {_count(light) / 1e6:.2f} M parameters, {box_time}")
        print(f"  image to pose: {million:.2f} M parameters, {all_time}")

    if options.sdn:
        net_sdn = sdn.Sdn(len(CLASSES), 18, 1)
        _write(sdn.Decoded(net_sdn, 0.0), box_detector.OUTPUTS, "sdn", "boxes", 640, folder / "sdn.onnx")
        detector = open_detector(folder / "sdn.onnx", registry, threads)
        box_time = _ms(lambda: detector.predict([image]), 5)
        print(f"sdn 640 px: {_count(net_sdn) / 1e6:.2f} M parameters, {box_time}")


def _write(
    decoded: nn.Module, outputs: tuple[str, ...], net: str, task: Task, size: int, path: Path
) -> None:
    points = {f"P{i}": [0.0, 0.0, float(i)] for i in range(POINTS)}
    card = ModelCard(
        net=net,
        task=task,
        classes=CLASSES,
        input_px=size,
        dataset_sha256="",
        scenario_sha256="",
        version="0",
        keypoints_body_m=dict.fromkeys(CLASSES, points),
    )
    picture = np.random.default_rng(1).uniform(0, 1, (1, 1, size, size)).astype(np.float32)
    with torch.no_grad():
        export(decoded, outputs, picture, card, path, lambda a, b: {}, ONNX_TRANSLATIONS)


def _count(net: nn.Module) -> int:
    return sum(parameter.numel() for parameter in net.parameters())


def _ms(run: Callable[[], object], repeats: int) -> str:
    """Median and least time of several runs. On a busy machine the least is the better estimate."""
    for _ in range(3):
        run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return f"{1e3 * np.median(times):.1f} ms (least {1e3 * min(times):.1f})"


if __name__ == "__main__":
    main()
