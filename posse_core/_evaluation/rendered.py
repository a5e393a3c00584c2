"""Whether frames of a dataset come out again when its scenario renders them anew.

The same seeds give the same bits on the same machine. On another one a renderer's samples and rounding
differ, so pictures need to agree within noise only.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import cv2
import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import SCENARIO, inside
from posse_core._errors import InputError
from posse_core._evaluation.pictures import light_of
from posse_core._evaluation.result import Fault, Result
from posse_core._evaluation.scenarios import Scenarios
from posse_core._model.label_line import LabelLine
from posse_core._plugins.loading import load_plugins
from posse_core._simulator.simulator import Simulator

LABEL_ERROR = 1e-6
"""Relative difference of labels."""
AREA_PX = 5
"""Side of the squares whose means are compared, so that noise averages out."""
MEAN_ERROR = 0.03
"""Mean difference of these over the mean brightness, at least of one step of 8 bits."""
LIGHT_ERROR, LIGHT_PX = 0.03, 100
"""Difference of the light of the whole picture, and of the target where it has so many pixels, over the
light; all of their noise averages out. Exposures may differ by as much, since a meter sees noise."""
PLACE_ERROR, PLACE_SHARE = 0.1, 0.005
"""Differences of a square, over white, that at most so many of the image's may exceed."""
_OF_THE_FILES = ("image", "truth", "sensors", "origin")


def check_rendered(
    dataset: Dataset, frames: int, progress: Callable[[Iterable[int], int], Iterable[int]]
) -> Result:
    """Render frames, evenly spread, and compare pictures and labels.

    Raises:
        InputError: the dataset has no scenario of its own that this machine can render.
    """
    scenarios = Scenarios(dataset)
    scenario = scenarios.own
    if scenario is None:
        why = scenarios.faults[0] if scenarios.faults else f"{dataset.folder}: has no {SCENARIO}"
        raise InputError(f"{why}; without it no frame can be rendered anew")
    result = Result("rendered", "frames come out again when the scenario renders them")
    positions = np.unique(np.linspace(0, len(dataset) - 1, frames).round().astype(int)).tolist()
    with Simulator(scenario, load_plugins().registry, dataset.trajectory) as simulator:
        for position in progress(positions, len(positions)):
            labels = dataset[position]
            made = simulator.frame(simulator.state(labels.index))
            result.checked += 1
            faults = [
                *_picture(dataset, labels, made.image, scenario.sensor.response),
                *_labels(labels, made.labels),
            ]
            result.faults += [Fault(labels.index, text) for text in faults]
    return result


def _picture(dataset: Dataset, labels: LabelLine, made: AnyArray, response: str) -> Iterator[str]:
    try:
        there = read_image(inside(dataset.folder, labels.image))
    except InputError as error:
        yield str(error)
        return
    if there.shape != made.shape or there.dtype != made.dtype:
        yield f"the picture is {there.dtype} {there.shape}, and rendered anew {made.dtype} {made.shape}"
        return
    if np.array_equal(there, made):
        return
    a, b = (_averaged(image) for image in (there, made))
    mean = float(np.abs(a - b).mean() / max(float(b.mean()), 1 / 255))
    share = float((np.abs(a - b) > PLACE_ERROR).mean())
    if mean > MEAN_ERROR or share > PLACE_SHARE:
        yield (
            f"the picture is not the one that is rendered anew: it differs by {mean:.1%} on the average,"
            f" and much in {share:.1%} of it"
        )
        return
    lights = [light_of(image, response).astype(np.float64) for image in (there, made)]
    places = {"picture": np.ones(lights[0].shape, dtype=bool)}
    if labels.has("mask_rle") and labels.mask_rle.mask().sum() >= LIGHT_PX:
        places["target"] = labels.mask_rle.mask()
    for what, where in places.items():
        ours, theirs = (float(light[where].mean()) for light in lights)
        if abs(ours - theirs) > LIGHT_ERROR * max(theirs, 1 / 255):
            yield f"the {what} is {ours / max(theirs, 1e-9):.3g} times as bright as rendered anew"
            return


def _averaged(image: AnyArray) -> FloatArray:
    """Means of squares, as shares of white."""
    light = image.astype(np.float64) / np.iinfo(image.dtype).max
    return np.asarray(cv2.blur(light, (AREA_PX, AREA_PX)), dtype=np.float64)


def _labels(there: LabelLine, made: LabelLine) -> Iterator[str]:
    ours, theirs = (json.loads(line.to_json()) for line in (there, made))
    if there.has("exposure_s") and made.has("exposure_s"):
        one, other = (values.pop("exposure_s") for values in (ours, theirs))
        if abs(one - other) > LIGHT_ERROR * other:
            yield f"exposure_s is {one:.4g}, and rendered anew {other:.4g}"
    for key in sorted((ours.keys() | theirs.keys()) - set(_OF_THE_FILES)):
        if key not in ours or key not in theirs or not _alike(ours[key], theirs[key]):
            yield f"{key} is not what the scenario's annotators make"


def _alike(a: Any, b: Any) -> bool:
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_alike(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_alike, a, b))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return bool(abs(a - b) <= LABEL_ERROR * max(1.0, abs(b)))
    return bool(a == b)
