"""The component of the keypoint network ``heatmap``, which sees squares around boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from torch import Tensor, nn

from posse_core import (
    AnyArray,
    BodyLabels,
    Camera,
    Detection,
    Float32Array,
    FloatArray,
    InputError,
    KeypointFinder,
    KeypointPlaces,
    LabelledImages,
    ModelCard,
    Square,
    nees,
    poses,
    seen_bodies,
    to_grey,
    true_box,
)
from posse_detect_torch.augment import (
    change_appearance,
    coarsen,
    in_front_of_some,
    move_points,
    random_view,
    warp,
)
from posse_detect_torch.batches import Batch
from posse_detect_torch.calibration import calibrate, widening
from posse_detect_torch.checkpoint import read_weights
from posse_detect_torch.export import Outputs, difference, export, raw_difference
from posse_detect_torch.heatmap import PLACES, Decoded, HeatMaps, losses, read
from posse_detect_torch.int8 import write_int8
from posse_detect_torch.learn import Lesson, device_of, first_net, learn
from posse_detect_torch.options import HeatmapOptions, trained_with
from posse_detect_torch.pictures import Cut, Pictures, cut_backgrounds, cut_pictures

OUTPUTS = ("points", "sigma", "share", "raw")
_ZOOM, _SHIFT = (0.45, 1.25), 0.08
"""The range of errors of a detector's boxes: where only a part of a spacecraft is lit, a box is often
around that part alone, and the whole is found in a square that is wider."""
_COARSE = 1 / 3
"""Share of the pictures that are coarsened."""
_COUNTS = 0.05
"""Least share of a place of a keypoint, of those that the true one may be at."""
_ROOM = 0.5
"""What cached squares have beyond the network's on each side, as a share of its side: little of a
picture that is turned, made smaller and shifted is empty then."""

_POSES = 100
"""So many pictures give the median that calibrates well enough; the poses of hundreds would take half as
long as to learn from thousands."""


class HeatmapLesson(Lesson):
    """Learns from squares around the labelled boxes, rotated by any angle."""

    net: HeatMaps
    options: HeatmapOptions

    def __init__(
        self, dataset: LabelledImages, folder: Path, card: ModelCard, options: HeatmapOptions
    ) -> None:
        self.options = options
        shown = {part: _shown(dataset, part, options.input_px) for part in ("train", "valid")}
        self._ranges = card.keypoint_outputs
        self._points_body_m = card.keypoint_arrays_m
        self._symmetries = {name: info.symmetries for name, info in dataset.classes.items()}
        self._camera = _camera_of(dataset)
        self._points = sum(len(points) for points in card.keypoints_body_m.values())
        self.net = first_net(options, lambda: HeatMaps(self._points, options.size))
        self._backgrounds = cut_backgrounds(dataset, options.input_px, folder, options.threads)
        size = _cut_px(options.input_px)
        masks = options.augment and len(self._backgrounds) > 0
        self._train, self._valid = (
            cut_pictures(
                dataset,
                cuts,
                size,
                folder,
                f"keypoints-{part}",
                masks=part == "train" and masks,
                threads=options.threads,
            )
            for part, cuts in shown.items()
        )

    def __len__(self) -> int:
        return len(self._train)

    def sample(self, position: int, random: np.random.Generator) -> dict[str, AnyArray]:
        size = self.options.input_px
        view = np.eye(2, 3)
        if self.options.augment:
            angle = random.uniform(0, 2 * np.pi) if self.options.turn else 0.0
            view = random_view(random, size, _ZOOM, _SHIFT, angle)
        picture, points = self._seen(self._train, position, view)
        if self.options.augment:
            if self._train.covered is not None:
                inside = self._into(self._train, position, view)
                covered = warp(self._train.coverage(position), inside, size)
                picture = in_front_of_some(picture, covered, self._backgrounds, random)
            if random.uniform() < _COARSE:
                picture = coarsen(picture, random)
            picture = change_appearance(picture, random)
        is_in = np.all((points > -0.5) & (points < size - 0.5), axis=1, keepdims=True)  # false for NaN
        return {
            "picture": picture[None],
            "points": np.where(is_in, points, 0).astype(np.float32),
            "weights": np.asarray(is_in[:, 0], np.float32),
        }

    def _seen(
        self, pictures: Pictures[BodyLabels], position: int, view: FloatArray
    ) -> tuple[Float32Array, FloatArray]:
        """Return the network's input (S, S) through a map of its pixels, and keypoints (P, 2) in them.

        Points of other classes and those behind the camera are NaN. Hidden points are learned too, since
        the visible shape determines where they are.
        """
        body = pictures.labels[position]
        points = np.full((self._points, 2), np.nan)
        known = np.array([point[:2] for point in body.keypoints.values()], dtype=np.float64)
        square = Square.around(true_box(body).box_px, self.options.input_px)
        points[self._ranges[body.spacecraft]] = square.points_in(known)
        inside = self._into(pictures, position, view)
        picture = warp(pictures.linear(position), inside, square.size_px)
        return picture, move_points(points + 0.5, view) - 0.5

    def _into(self, pictures: Pictures[BodyLabels], position: int, view: FloatArray) -> FloatArray:
        """Return the map (2, 3) from a cached square to the network's input through ``view``."""
        square = Square.around(true_box(pictures.labels[position]).box_px, self.options.input_px)
        cut = pictures.squares[position]
        scale = square.scale / cut.scale
        corner = square.scale * (np.array([cut.x_px, cut.y_px]) - [square.x_px, square.y_px])
        return np.column_stack([scale * view[:, :2], view[:, :2] @ corner + view[:, 2]])

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        return losses(self.net(batch["picture"]), batch["points"], batch["weights"])

    @torch.inference_mode()
    def judge(self, net: nn.Module) -> dict[str, float]:
        """Calibrate the standard deviations of ``net``, and measure it.

        Returns:
            The median error of the keypoints in per cent of the square's side; the share of the
            coordinates whose error is within their standard deviation; and, where the labels have poses,
            the share of the estimated poses in the region that is to hold 95 %.
        """
        if len(self._valid) == 0:
            return {}
        assert isinstance(net, HeatMaps)
        net.eval()
        device, size = next(net.parameters()).device, self.options.input_px
        shape = len(self._valid), self._points, PLACES
        points, away = np.zeros((*shape, 2)), np.full((*shape, 2), np.nan)
        spread, share = np.zeros(shape), np.zeros(shape)
        for position in range(len(self._valid)):
            picture, true = self._seen(self._valid, position, np.eye(2, 3))
            inside = np.all((true > -0.5) & (true < size - 0.5), axis=1)
            found = read(net(torch.from_numpy(picture)[None, None].to(device)))
            points[position], spread[position], share[position] = (x[0].cpu().numpy() for x in found)
            away[position][inside] = (points[position] - true[:, None])[inside]
        known = np.isfinite(away[..., 0, 0])
        # A keypoint is as far off as its place that is nearest: which one it is at, the pose tells.
        distance = np.linalg.norm(away[known], axis=-1)
        nearest = np.argmin(np.where(share[known] > _COUNTS, distance, np.inf), axis=-1)[:, None]
        off_px = np.take_along_axis(away[known], nearest[..., None], axis=1)[:, 0]
        spread_px, part = (np.take_along_axis(x[known], nearest, axis=1)[:, 0] for x in (spread, share))
        fitted = calibrate(off_px, spread_px, part)
        sigma_px = np.exp(fitted[0] + fitted[1] * np.log(spread) + fitted[2] * np.log(share))
        within = self._nees(points, sigma_px, share)
        factor = widening(within)
        fitted[0] += np.log(factor)
        net.calibration.copy_(torch.from_numpy(fitted))
        told_px = factor * np.take_along_axis(sigma_px[known], nearest, axis=1)
        told = {
            "valid median error, %": 100 * float(np.median(distance[:, 0])) / size,
            "valid within sigma": float(np.mean(np.abs(off_px) < told_px)),
        }
        if len(within):
            told["valid poses in 95 %"] = float(np.mean(within / factor**2 < chi2.ppf(0.95, 6)))
        return told

    def _nees(self, points: FloatArray, sigma_px: FloatArray, share: FloatArray) -> FloatArray:
        """Return the normalised errors squared of the poses from keypoints (N, P, M, 2) of the valid
        part, where labels and keypoints give poses, of :data:`_POSES` pictures at most."""
        found = []
        count = len(self._valid.labels)
        for position in np.linspace(0, count - 1, min(count, _POSES)).round().astype(int):
            body = self._valid.labels[position]
            if self._camera is None or not body.has("q_cam_from_body"):
                continue
            square = Square.around(true_box(body).box_px, self.options.input_px)
            mine = self._ranges[body.spacecraft]
            known_m = self._points_body_m[body.spacecraft]
            places = KeypointPlaces(
                square.points_out(points[position, mine]),
                sigma_px[position, mine] / square.scale,
                share[position, mine],
            )
            seen = Detection(body.spacecraft, 1.0, true_box(body).box_px).with_places(places)
            for estimate in poses(known_m, seen, self._camera)[:1]:
                R = Rotation.from_quat(np.roll(body.q_cam_from_body, -1)).as_matrix()
                t, symmetries = np.array(body.t_body_cam_m), self._symmetries[body.spacecraft]
                place = estimate.R_cam_from_body, estimate.t_body_cam_m
                found.append(nees(R, t, *place, estimate.covariance, symmetries))
        return np.array(found)


class HeatmapFinder(KeypointFinder[HeatmapOptions]):
    """Finds keypoints with :class:`posse_detect_torch.heatmap.HeatMaps`."""

    def train(self, dataset: LabelledImages, folder: Path) -> Path:
        """See :class:`posse_core.Model`.

        Raises:
            InputError: The dataset was not partitioned, or lacks boxes or keypoints.
        """
        card = ModelCard.of_dataset(
            dataset,
            net="heatmap",
            task="keypoints",
            input_px=self.options.input_px,
            options=self.options.model_dump(mode="json"),
            version=version("posse-detect-torch"),
        )
        return learn(lambda: HeatmapLesson(dataset, folder, card, self.options), card, folder)

    def load(self, path: Path) -> None:
        self._card = ModelCard.read(path)
        if self._card.net != "heatmap":
            raise InputError(f"{path}: is a model of {self._card.net!r}, not of 'heatmap'")
        self.classes = self._card.classes
        self.keypoints_body_m = self._card.keypoint_arrays_m
        self.knows_any_roll = self._card.knows_any_roll
        try:
            size = trained_with(self._card, HeatmapOptions).size
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        net = HeatMaps(sum(map(len, self.keypoints_body_m.values())), size)
        read_weights(path, net)
        self._decoded = Decoded(net).eval().to(device_of(self.options))

    def find(self, image: AnyArray, detections: Sequence[Detection]) -> list[Detection]:
        ranges, found = self._card.keypoint_outputs, []
        device = next(self._decoded.parameters()).device
        for detection in detections:
            square = Square.around(detection.box_px, self._card.input_px)
            with torch.inference_mode():
                outputs = self._decoded(torch.from_numpy(_picture(image, square))[None].to(device))
            mine = ranges[detection.label]
            points, sigma, share = (value[0, mine].double().cpu().numpy() for value in outputs[:3])
            places = KeypointPlaces(square.points_out(points), sigma / square.scale, share)
            found.append(detection.with_places(places))
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


def _camera_of(dataset: LabelledImages) -> Camera | None:
    """The camera, which labels of other makers may lack."""
    try:
        return dataset.camera
    except InputError:
        return None


def _cut_px(size_px: int) -> int:
    return round(size_px * (1 + 2 * _ROOM))


def _shown(dataset: LabelledImages, part: str, size_px: int) -> list[Cut[BodyLabels]]:
    """Return what is cached of the bodies that a part's frames show; check for keypoints.

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
                seen = Square.around(true_box(body).box_px, size_px)
                room = round(_ROOM * seen.side_px)
                corner = seen.x_px - room, seen.y_px - room
                square = Square(*corner, seen.side_px + 2 * room, _cut_px(size_px))
                cuts.append(Cut(position, body, square))
    return cuts


def _picture(image: AnyArray, square: Square) -> Float32Array:
    """Return the network's input (1, S, S)."""
    return square.cut(to_grey(image))[None]


def _compare(ours: Outputs, theirs: Outputs) -> dict[str, tuple[float, float]]:
    """Compare the raw tensors, and what is read around the highest cells: rounding may decide which of
    two lower ones is the higher."""
    return {
        "raw": (raw_difference(ours["raw"], theirs["raw"]), 1e-4),
        "points, px": (difference(ours["points"][:, :, 0], theirs["points"][:, :, 0]), 0.1),
        "sigma, px": (difference(ours["sigma"][:, :, 0], theirs["sigma"][:, :, 0]), 0.1),
        "share": (difference(ours["share"][:, :, 0], theirs["share"][:, :, 0]), 1e-3),
    }
