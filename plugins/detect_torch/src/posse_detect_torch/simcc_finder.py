"""The component of the keypoint network ``simcc``, which sees squares around boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from posse_core import (
    AnyArray,
    BodyLabels,
    Detection,
    Float32Array,
    FloatArray,
    InputError,
    KeypointFinder,
    LabelledImages,
    ModelCard,
    Square,
    seen_bodies,
    to_grey,
    true_box,
)
from posse_detect_torch.augment import change_appearance, move_points, random_view, warp
from posse_detect_torch.checkpoint import read_weights
from posse_detect_torch.export import Outputs, difference, export, raw_difference
from posse_detect_torch.int8 import write_int8
from posse_detect_torch.learn import Batch, Lesson, device_of, first_net, learn
from posse_detect_torch.options import SimccOptions
from posse_detect_torch.pictures import Cut, Pictures, cut_pictures
from posse_detect_torch.simcc import Decoded, SimCC, losses

OUTPUTS = ("points", "sigma", "raw")
_ZOOM, _SHIFT = (0.8, 1.2), 0.08  # the range of errors of a detector's boxes


class SimccLesson(Lesson):
    """Learns from squares around the labelled boxes, rotated by any angle."""

    net: SimCC
    options: SimccOptions

    def __init__(
        self, dataset: LabelledImages, folder: Path, card: ModelCard, options: SimccOptions
    ) -> None:
        self.options = options
        size = options.input_px
        shown = {part: _shown(dataset, part, size) for part in ("train", "valid")}
        self._ranges = card.keypoint_outputs
        self._points = sum(len(points) for points in card.keypoints_body_m.values())
        self.net = first_net(options, lambda: SimCC(self._points))
        self._train, self._valid = (
            cut_pictures(dataset, cuts, size, folder, f"keypoints-{part}")
            for part, cuts in shown.items()
        )

    def __len__(self) -> int:
        return len(self._train)

    def sample(self, position: int, random: np.random.Generator) -> dict[str, AnyArray]:
        size = self.options.input_px
        picture, points = self._train.linear(position), self._target(self._train, position)
        if self.options.augment:
            angle = random.uniform(0, 2 * np.pi) if self.options.turn else 0.0
            view = random_view(random, size, _ZOOM, _SHIFT, angle)
            picture = change_appearance(warp(picture, view), random)
            points = move_points(points + 0.5, view) - 0.5
        inside = np.all((points > -0.5) & (points < size - 0.5), axis=1, keepdims=True)  # false for NaN
        return {
            "picture": picture[None],
            "points": np.where(inside, points, 0).astype(np.float32),
            "weights": np.asarray(inside[:, 0], np.float32),
        }

    def _target(self, pictures: Pictures[BodyLabels], position: int) -> AnyArray:
        """Return (P, 2) pixels of the square; NaN for points of other classes and behind the camera.

        Hidden points are learned too, since the visible shape determines where they are.
        """
        body = pictures.labels[position]
        points = np.full((self._points, 2), np.nan)
        known = np.array([point[:2] for point in body.keypoints.values()], dtype=np.float64)
        points[self._ranges[body.spacecraft]] = pictures.squares[position].points_in(known)
        return points

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        return losses(self.net(batch["picture"]), batch["points"], batch["weights"])

    @torch.inference_mode()
    def judge(self, net: nn.Module) -> dict[str, float]:
        """Return the median error of the keypoints in per cent of the square's side."""
        if len(self._valid) == 0:
            return {}
        assert isinstance(net, SimCC)
        decoded, device = Decoded(net).eval(), next(net.parameters()).device
        away: list[float] = []
        for position in range(len(self._valid)):
            found = decoded(torch.from_numpy(self._valid.linear(position))[None, None].to(device))[0][0]
            distance = np.linalg.norm(found.cpu().numpy() - self._target(self._valid, position), axis=1)
            away += distance[np.isfinite(distance)].tolist()
        return {"valid median error, %": 100 * float(np.median(away)) / self.options.input_px}


class SimccFinder(KeypointFinder[SimccOptions]):
    """Finds keypoints with :class:`posse_detect_torch.simcc.SimCC`."""

    def train(self, dataset: LabelledImages, folder: Path) -> Path:
        """See :class:`posse_core.Model`.

        Raises:
            InputError: The dataset was not partitioned, or lacks boxes or keypoints.
        """
        card = ModelCard.of_dataset(
            dataset,
            net="simcc",
            task="keypoints",
            input_px=self.options.input_px,
            options=self.options.model_dump(mode="json"),
            version=version("posse-detect-torch"),
        )
        return learn(lambda: SimccLesson(dataset, folder, card, self.options), card, folder)

    def load(self, path: Path) -> None:
        self._card = ModelCard.read(path)
        if self._card.net != "simcc":
            raise InputError(f"{path}: is a model of {self._card.net!r}, not of 'simcc'")
        self.classes = self._card.classes
        self.keypoints_body_m = self._card.keypoint_arrays_m
        net = SimCC(sum(map(len, self.keypoints_body_m.values())))
        read_weights(path, net)
        self._decoded = Decoded(net).eval().to(device_of(self.options))

    def find(self, image: AnyArray, detections: Sequence[Detection]) -> list[Detection]:
        ranges, found = self._card.keypoint_outputs, []
        device = next(self._decoded.parameters()).device
        for detection in detections:
            square = Square.around(detection.box_px, self._card.input_px)
            with torch.inference_mode():
                outputs = self._decoded(torch.from_numpy(_picture(image, square))[None].to(device))
            points, sigma = (value[0].double().cpu().numpy() for value in outputs[:2])
            mine = ranges[detection.label]
            pixels = square.points_out(points[mine])
            sigma_px = sigma[mine] / square.scale
            found.append(replace(detection, keypoints_px=pixels, keypoints_sigma_px=sigma_px))
        return found

    def export_onnx(self, path: Path, images: Sequence[AnyArray]) -> Mapping[str, float]:
        size = self._card.input_px
        squares = [Square.around(np.array([0, 0, *image.shape[1::-1]]), size) for image in images]
        pictures = [_picture(image, square) for image, square in zip(images, squares, strict=True)]
        return export(self._decoded, OUTPUTS, np.stack(pictures), self._card, path, _compare)

    def write_int8(self, path: Path, out: Path, seen: Sequence[tuple[AnyArray, FloatArray]]) -> None:
        size = self._card.input_px
        pictures = (_picture(image, Square.around(box, size)) for image, box in seen)
        write_int8(path, out, pictures)


def _shown(dataset: LabelledImages, part: str, size_px: int) -> list[Cut[BodyLabels]]:
    """Return the squares around the bodies that a part's frames show; check for keypoints.

    A body whose class has no keypoints is left out.
    """
    cuts: list[Cut[BodyLabels]] = []
    for position in dataset.part(part):
        for body in seen_bodies(dataset[position]).values():
            if not body.has("keypoints"):
                raise InputError(
                    f"{dataset.folder}: the labels have no keypoints; make the dataset with the"
                    " annotator 'keypoints', or add spacecraft/NAME.json to a COCO folder"
                )
            if body.keypoints:
                square = Square.around(true_box(body).box_px, size_px)
                cuts.append(Cut(position, body, square))
    return cuts


def _picture(image: AnyArray, square: Square) -> Float32Array:
    """Return the network's input (1, S, S)."""
    return square.cut(to_grey(image))[None]


def _compare(ours: Outputs, theirs: Outputs) -> dict[str, tuple[float, float]]:
    return {
        "raw": (raw_difference(ours["raw"], theirs["raw"]), 1e-4),
        "points, px": (difference(ours["points"], theirs["points"]), 0.1),
        "sigma, px": (difference(ours["sigma"], theirs["sigma"]), 0.1),
    }
