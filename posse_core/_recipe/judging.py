"""How good a recipe's models are: on the test part by group, and on images without a spacecraft."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from pydantic import JsonValue

from posse_core._arrays import evenly_spread
from posse_core._dataset.dataset import Dataset
from posse_core._detection.draw import draw
from posse_core._detection.evaluate import Judge, Judged, frames_of
from posse_core._detection.groups import Group, groups
from posse_core._detection.known import target_shapes
from posse_core._detection.models import open_models
from posse_core._detection.page import make_page
from posse_core._detection.pose_detector import LEAST_SCORE
from posse_core._detection.processes import made_by
from posse_core._evaluation.pages import jpeg, page, paragraph, strip
from posse_core._files.atomic import write_bytes, write_json
from posse_core._files.reading import FileRecord
from posse_core._imaging.grey import to_grey
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.loading import load_plugins
from posse_core._randomness import random_generator
from posse_core._recipe.data import Kitchen
from posse_core._recipe.training import MODEL
from posse_core._scenario.component import ComponentChoice

EVALUATION: Final = "evaluation.json"
PAGE: Final = "evaluation.html"
PICTURES: Final = "predictions.html"
PART: Final = "test"
LEAST_EVALUATED: Final = 20
"""Frames that are evaluated, however little time is left."""
_PICTURES: Final = 32
_WIDTH_PX: Final = 480
_SOURCE: Final = "source "


class Evaluation(FileRecord):
    """The accuracy of a recipe's models.

    Attributes:
        dataset_sha256: of the dataset.
        groups: of the test part: all frames, those of each source with the spacecraft, and others.
        without_craft: number of frames that show no spacecraft.
        found_without_craft: number of those in which something was detected.
    """

    dataset_sha256: str
    groups: list[Group]
    without_craft: int
    found_without_craft: int


def judge(kitchen: Kitchen, dataset: Dataset, folder: Path, until_s: float) -> None:
    """Evaluate the models on the test part: :data:`PAGE`, :data:`PICTURES`, and last :data:`EVALUATION`.

    Args:
        kitchen: of the recipe.
        dataset: that the models learned from.
        folder: of the recipe.
        until_s: time of ``time.monotonic`` after which no frame is begun, if enough were evaluated.

    Raises:
        InputError: the test part is empty, or a model cannot be used.
    """
    boxes, keypoints = (folder / task / MODEL for task in kitchen.recipe.nets)
    positions = frames_of(dataset, PART)
    title = f"The pose of {dataset.spacecraft.name}, part {PART}"
    registry, recipe = kitchen.plugins.registry, kitchen.recipe
    opened = partial(_judge, boxes, keypoints, kitchen.scenarios.spacecraft, recipe.refiner)
    with contextlib.closing(opened(dataset)) as judge:
        taken = in_time(positions, recipe.seed, until_s)
        again = partial(_judge_of, dataset.folder, opened)
        results = made_by(judge, taken, again, recipe.workers, registry)
        judged = list(kitchen.show.bar(results, len(positions), "evaluating"))
    judged.sort(key=lambda each: each.labels.index)
    spread = [judged[k] for k in evenly_spread(len(judged), _PICTURES)]
    pictures = _pictures(dataset, spread, title)
    found = groups(dataset, judged)
    for name, source in kitchen.recipe.data.sources.items():
        mine = [j for j in judged if j.bodies and j.labels.origin[0] == name]
        if source.craft and mine:
            found.append(replace(groups(dataset, mine)[0], name=f"{_SOURCE}{name}"))
    empty = [j for j in judged if not j.bodies]
    wrong = sum(any(d.score >= LEAST_SCORE for d in j.detections) for j in empty)
    summary = f"Dataset's SHA-256: {dataset.sha256}"
    write_bytes(folder / PAGE, make_page(title, summary, dataset, judged, found).encode())
    write_bytes(folder / PICTURES, pictures.encode())
    record: dict[str, JsonValue] = Evaluation(
        dataset_sha256=dataset.sha256,
        groups=found,
        without_craft=len(empty),
        found_without_craft=wrong,
    ).model_dump(mode="json")
    write_json(folder / EVALUATION, record)


def _judge(
    boxes: Path,
    keypoints: Path,
    spacecraft: Spacecraft,
    refiner: ComponentChoice | None,
    dataset: Dataset,
) -> Judge:
    """A judge of the recipe's models."""
    registry = load_plugins().registry
    detector, finder = open_models(boxes, keypoints, registry, {})
    return Judge(dataset, detector, finder, target_shapes(spacecraft, registry, refiner))


def _judge_of(folder: Path, opened: Callable[[Dataset], Judge]) -> Judge:
    """The judge of a worker, which opens the dataset itself."""
    return opened(Dataset(folder))


def in_time(positions: Sequence[int], seed: int, until_s: float) -> Iterator[int]:
    """Positions in a random order, as many as are begun before a time, and at least
    :data:`LEAST_EVALUATED`, or all.

    Args:
        positions: to choose from.
        seed: of the order.
        until_s: of ``time.monotonic``.
    """
    order = random_generator(seed, -1, "evaluation").permutation(len(positions))
    for count, k in enumerate(order.tolist()):
        if count >= LEAST_EVALUATED and time.monotonic() >= until_s:
            return
        yield positions[k]


def _pictures(dataset: Dataset, judged: Sequence[Judged], title: str) -> str:
    """A page with frames, and what is found in them."""
    captions, pictures = [], []
    for each in judged:
        labels, found = each.labels, each.detections[:1]
        image = dataset.image(dataset.position(labels.index))
        pose = each.bodies[0].pose if each.bodies else None
        words = f"frame {labels.index}, {labels.origin[0]}"
        if labels.box_visible_px is None:
            words += ": no spacecraft"
        elif pose is not None:
            words += (
                f": position off by {100 * pose.e_t:.2g} % of the range, attitude by"
                f" {np.degrees(pose.e_q_rad):.2g}°"
            )
        captions.append(f"{words}, {'nothing found' if not found else f'score {found[0].score:.2f}'}")
        scale = _WIDTH_PX / image.shape[1]
        light = np.sqrt(to_grey(image))
        size = (_WIDTH_PX, round(image.shape[0] * scale))
        small = cv2.resize(light, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST)
        drawn = [
            replace(
                d,
                box_px=d.box_px * scale,
                keypoints_px=None if d.keypoints_px is None else (d.keypoints_px + 0.5) * scale - 0.5,
            )
            for d in found
        ]
        canvas = np.round(255 * small).astype(np.uint8)
        pictures.append(jpeg(draw(canvas, drawn, sorted(dataset.classes))))
    said = (
        "Frames of the test part, evenly spread, with the best detection. Pictures show the square root"
        f" of the grey values. A score below {LEAST_SCORE} counts as nothing."
    )
    return page(title, said, [strip("Found", captions, pictures), paragraph(said)])
