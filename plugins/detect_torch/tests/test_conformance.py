"""The conformance kit on the networks, with weights that have learned nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch
from torch import nn

from posse_core import Model, ModelCard
from posse_core.testing import DetectorConformance
from posse_detect_torch.checkpoint import write_model
from posse_detect_torch.heatmap import HeatMaps
from posse_detect_torch.heatmap_finder import HeatmapFinder
from posse_detect_torch.nano_detector import NanoDetector
from posse_detect_torch.options import HeatmapOptions, NanoOptions, SdnOptions
from posse_detect_torch.sdn_detector import SdnDetector

CLASSES = ("brick", "plate")
POINTS = {"brick": {"B1": [0.0, 0.0, 1.0]}, "plate": {"A1": [0.0, 0.0, 0.0], "A2": [1.0, 0.0, 0.0]}}


def card(net: str, task: str, options: Any) -> ModelCard:
    return ModelCard(
        net, task, CLASSES, 64, "", "", "0", POINTS, options=options.model_dump(mode="json")
    )


@pytest.fixture(autouse=True, scope="class")
def file(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Write the model file of a class, which all of its tests load."""
    torch.manual_seed(3)
    request.cls.path = tmp_path_factory.mktemp("net") / "model.safetensors"
    net, described = request.cls.untrained()
    write_model(request.cls.path, net.state_dict(), described)


class TestNano(DetectorConformance):
    capabilities = frozenset({"boxes", "train", "onnx", "int8"})

    path: Path

    @staticmethod
    def untrained() -> tuple[nn.Module, ModelCard]:
        described = card("nano", "boxes", NanoOptions(input_px=64))
        return NanoDetector(NanoOptions()).net(described), described

    def detector(self) -> Model[Any]:
        detector = NanoDetector(NanoOptions())
        detector.load(self.path)
        return detector


@pytest.mark.slow
class TestSdn(DetectorConformance):
    capabilities = frozenset({"boxes", "train", "onnx", "int8"})

    path: Path

    @staticmethod
    def untrained() -> tuple[nn.Module, ModelCard]:
        described = card("sdn", "boxes", SdnOptions(input_px=64))
        return SdnDetector(SdnOptions()).net(described), described

    def detector(self) -> Model[Any]:
        detector = SdnDetector(SdnOptions())
        detector.load(self.path)
        return detector


class TestHeatmap(DetectorConformance):
    capabilities = frozenset({"keypoints", "train", "onnx", "int8"})

    path: Path

    @staticmethod
    def untrained() -> tuple[nn.Module, ModelCard]:
        return HeatMaps(3), card("heatmap", "keypoints", HeatmapOptions(input_px=64))

    def detector(self) -> Model[Any]:
        detector = HeatmapFinder(HeatmapOptions())
        detector.load(self.path)
        return detector
