"""Base classes of the detectors that find boxes: samples, evaluation, prediction and export."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import ClassVar, TypeVar

import numpy as np
import torch
from torch import nn

from posse_core import (
    AnyArray,
    Detection,
    Detector,
    Float32Array,
    FloatArray,
    InputError,
    LabelledImages,
    LabelLine,
    ModelCard,
    Square,
    TrueBox,
    coco_metrics,
    to_grey,
    true_boxes,
)
from posse_detect_torch.augment import (
    change_appearance,
    in_front_of_some,
    move_boxes,
    random_view,
    warp,
)
from posse_detect_torch.checkpoint import read_weights
from posse_detect_torch.export import Outputs, compare_detections, export
from posse_detect_torch.int8 import write_int8
from posse_detect_torch.learn import Lesson, device_of, first_net, learn
from posse_detect_torch.options import BoxOptions
from posse_detect_torch.pictures import Cut, Pictures, cut_backgrounds, cut_pictures

OUTPUTS = ("boxes", "scores", "labels", "raw")
_ZOOM, _SHIFT = (0.7, 1.4), 0.2
_LEAST_SIDE_PX = 3.0  # boxes that are smaller after a shift are not learned

BoxOptionsT = TypeVar("BoxOptionsT", bound=BoxOptions)


class BoxLesson(Lesson):
    """Learns from whole frames, which augmentation rotates by multiples of 90°, zooms and shifts."""

    options: BoxOptions

    def __init__(
        self, dataset: LabelledImages, folder: Path, classes: Sequence[str], options: BoxOptions
    ) -> None:
        self.classes, self.options = classes, options
        self.net = first_net(options, self.untrained)
        self._backgrounds = cut_backgrounds(dataset, options.input_px, folder, options.threads)
        self.train, self.valid = (self._cut(dataset, folder, part) for part in ("train", "valid"))
        self._most = max([1, *(len(true_boxes(line)) for line in self.train.labels)])

    def _cut(self, dataset: LabelledImages, folder: Path, part: str) -> Pictures[LabelLine]:
        size = self.options.input_px
        cuts = [
            Cut(i, dataset[i], Square.of_image(*dataset.size_px(i), size)) for i in dataset.part(part)
        ]
        masks = part == "train" and self.options.augment and len(self._backgrounds) > 0
        threads = self.options.threads
        return cut_pictures(dataset, cuts, size, folder, part, masks=masks, threads=threads)

    @abstractmethod
    def untrained(self) -> nn.Module:
        """Return the network before training."""

    @abstractmethod
    def decoded(self, net: nn.Module) -> nn.Module:
        """Return ``net`` with its decoding."""

    def __len__(self) -> int:
        return len(self.train) if any(true_boxes(line) for line in self.train.labels) else 0

    def sample(self, position: int, random: np.random.Generator) -> dict[str, AnyArray]:
        size = self.options.input_px
        picture = self.train.linear(position)
        boxes, labels = self.target(self.train, position)
        # Pictures of one batch have arrays of one shape.
        missing = self._most - len(labels)
        boxes = np.concatenate([boxes, np.zeros((missing, 4))])
        labels = np.concatenate([labels, np.full(missing, -1)])
        if self.options.augment:
            angle = np.pi / 2 * random.integers(4) if self.options.turn else 0.0
            view = random_view(random, size, _ZOOM, _SHIFT, angle)
            picture = warp(picture, view, size)
            if self.train.covered is not None:
                covered = warp(self.train.coverage(position), view, size)
                picture = in_front_of_some(picture, covered, self._backgrounds, random)
            picture = change_appearance(picture, random)
            boxes = move_boxes(boxes, view, size)
            labels[(boxes[:, 2:] - boxes[:, :2]).min(axis=1) < _LEAST_SIDE_PX] = -1
        draw = np.array(random.integers(2**31), np.int64)  # a seed for the random choices of the losses
        return {
            "picture": picture[None],
            "boxes": boxes.astype(np.float32),
            "labels": labels,
            "draw": draw,
        }

    def target(self, pictures: Pictures[LabelLine], position: int) -> tuple[FloatArray, AnyArray]:
        """Return the boxes of a picture and their classes, as the network learns them.

        Returns:
            (M, 4) left, top, right, bottom in the picture, and the (M,) int64 indices of the classes,
            of the M bodies that it shows.
        """
        truths = true_boxes(pictures.labels[position])
        boxes_px = np.array([truth.box_px for truth in truths]).reshape(-1, 4)
        boxes = pictures.squares[position].boxes_in(boxes_px)
        boxes[:, 2:] += boxes[:, :2]
        return boxes, np.array([self.classes.index(truth.label) for truth in truths], np.int64)

    @torch.inference_mode()
    def judge(self, net: nn.Module) -> dict[str, float]:
        if len(self.valid) == 0:
            return {}
        decoded = self.decoded(net).eval()
        device = next(net.parameters()).device
        size = self.options.input_px
        whole = Square(0, 0, size, size)
        truths, found = [], []
        for position in range(len(self.valid)):
            box, label = self.target(self.valid, position)
            seen = np.concatenate([box[:, :2], box[:, 2:] - box[:, :2]], axis=1)
            truths.append([TrueBox(self.classes[i], b) for i, b in zip(label, seen, strict=True)])
            outputs = decoded(torch.from_numpy(self.valid.linear(position))[None, None].to(device))
            boxes, scores, labels = (value[0].cpu().numpy() for value in outputs[:3])
            found.append(whole.detections_out(boxes, scores, labels, self.classes, size, size))
        metrics = coco_metrics(truths, found, self.classes)
        return {f"valid {name}": metrics[name] for name in ("mAP", "mAP50", "mAR")}


class BoxDetector(Detector[BoxOptionsT]):
    """A detector that finds boxes with a network."""

    name: ClassVar[str]

    @abstractmethod
    def lesson(self, dataset: LabelledImages, folder: Path, card: ModelCard) -> BoxLesson:
        """Return the lesson that the network learns."""

    @abstractmethod
    def net(self, card: ModelCard) -> nn.Module:
        """Make the network that a card describes, without reading its weights."""

    @abstractmethod
    def decoded(self, net: nn.Module) -> nn.Module:
        """Return ``net`` with its decoding: pictures → boxes, scores, labels, raw."""

    def compare(self, ours: Outputs, theirs: Outputs) -> Mapping[str, tuple[float, float]]:
        """See :data:`posse_detect_torch.export.Compare`."""
        return compare_detections(ours, theirs)

    def train(self, dataset: LabelledImages, folder: Path) -> Path:
        """See :class:`posse_core.Model`.

        Raises:
            InputError: The dataset was not partitioned, has no boxes, or shows no spacecraft.
        """
        card = ModelCard.of_dataset(
            dataset,
            net=self.name,
            task="boxes",
            input_px=self.options.input_px,
            options=self.options.model_dump(mode="json"),
            version=version("posse-detect-torch"),
        )
        return learn(lambda: self.lesson(dataset, folder, card), card, folder)

    def load(self, path: Path) -> None:
        self._card = ModelCard.read(path)
        if self._card.net != self.name:
            raise InputError(f"{path}: is a model of {self._card.net!r}, not of {self.name!r}")
        self.classes = self._card.classes
        try:
            net = self.net(self._card)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        read_weights(path, net)
        self._decoded = self.decoded(net).eval().to(device_of(self.options))

    def predict(self, images: Sequence[AnyArray]) -> list[list[Detection]]:
        return [self._predict(image) for image in images]

    def _predict(self, image: AnyArray) -> list[Detection]:
        picture, square = _picture(image, self._card.input_px)
        device = next(self._decoded.parameters()).device
        with torch.inference_mode():
            found = self._decoded(torch.from_numpy(picture)[None].to(device))
        boxes, scores, labels = (value[0].cpu().numpy() for value in found[:3])
        return square.detections_out(boxes, scores, labels, self.classes, *image.shape[:2])

    def export_onnx(self, path: Path, images: Sequence[AnyArray]) -> Mapping[str, float]:
        pictures = np.stack([_picture(image, self._card.input_px)[0] for image in images])
        # this imports onnxscript, which is slow and not needed for training
        from posse_detect_torch.regions_onnx import ONNX_TRANSLATIONS

        return export(
            self._decoded, OUTPUTS, pictures, self._card, path, self.compare, ONNX_TRANSLATIONS
        )

    def write_int8(self, path: Path, out: Path, seen: Sequence[tuple[AnyArray, FloatArray]]) -> None:
        pictures = (_picture(image, self._card.input_px)[0] for image, _ in seen)
        write_int8(path, out, pictures)


def _picture(image: AnyArray, size_px: int) -> tuple[Float32Array, Square]:
    """Return the network's input (1, S, S), and its square in the image."""
    square = Square.of_image(image.shape[0], image.shape[1], size_px)
    return square.cut(to_grey(image))[None], square
