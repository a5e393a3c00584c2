"""How sure ``posse validate`` is of pictures: ``python benchmarks/pictures.py FOLDER...``.

Every picture of the datasets is compared with its labels as it is, and altered in each of some ways.
What is printed are the frames in light, those of them that are proven, the false alarms, and the share
of the alterations that are found in the proven frames in light, with the frames in which one was missed.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.files import read_image
from posse_core._evaluation.case import Case
from posse_core._evaluation.drawings import Scene
from posse_core._evaluation.pictures import LEAST_SUNLIGHT, REMEMBERED, PictureChecks
from posse_core._evaluation.scenarios import Scenarios

Altered = Callable[[list[AnyArray], int], AnyArray]
DIRECTIONS = {
    "right": (2, 0),
    "left": (-2, 0),
    "down": (0, 2),
    "up": (0, -2),
    "right and down": (2, 2),
    "right and up": (2, -2),
    "left and down": (-2, 2),
    "left and up": (-2, -2),
}


def _shifted(u: int, v: int) -> Altered:
    return lambda images, i: np.roll(images[i], (v, u), axis=(0, 1))


ALTERED: dict[str, Altered] = {
    **{f"shifted by 2 px {name}": _shifted(u, v) for name, (u, v) in DIRECTIONS.items()},
    "shifted by 10 px": _shifted(10, 0),
    "mirrored": lambda images, i: images[i][:, ::-1],
    "upside down": lambda images, i: images[i][::-1],
    "turned by 180°": lambda images, i: images[i][::-1, ::-1],
    "black": lambda images, i: np.zeros_like(images[i]),
    "negative": lambda images, i: np.iinfo(images[i].dtype).max - images[i],
}
OF_OTHERS = {"of the next frame": 1, "of another frame": 3}
"""Pictures of another frame, by how many frames later it is."""
CHANNELS = {"blue, green, red": (2, 1, 0), "green, red, blue": (1, 0, 2), "green, blue, red": (1, 2, 0)}
BESIDE = REMEMBERED
"""Frames before and after the altered one that are compared, too."""
MOVED_PX = 2.0
"""By how much the vertices of the target differ, root mean square, in two frames that differ."""
LEAST_LIT_PX = 100
"""Pixels of the target that the Sun lights in a frame in light."""


class Remembering(PictureChecks):
    """Checks that compute only once what a frame's pictures are compared with."""

    def __init__(self, scenarios: Scenarios, known: dict[int, Scene]) -> None:
        super().__init__(scenarios)
        self._known = known

    def scene(self, case: Case) -> Scene:
        """What a frame's picture is compared with."""
        index = case.labels.index
        if index not in self._known:
            self._known[index] = super().scene(case)
        return self._known[index]


@click.command()
@click.argument("folders", type=click.Path(path_type=Path), nargs=-1, required=True)
def main(folders: tuple[Path, ...]) -> None:
    """Compare the pictures of datasets in FOLDERS."""
    found: Counter[str] = Counter()
    tried: Counter[str] = Counter()
    frames = alarms = in_light = proven = proven_in_light = 0
    start_s = time.process_time()
    for folder in folders:
        dataset = Dataset(folder)
        scenarios = Scenarios(dataset)
        cases = [Case(dataset, labels) for labels in dataset]
        images = [read_image(folder / case.labels.image) for case in cases]
        known: dict[int, Scene] = {}
        for i, case in enumerate(cases):
            where = f"{folder.name} frame {case.labels.index}"
            checks = Remembering(scenarios, known)
            checked, faults = _compared(checks, cases, images, i, images[i], BESIDE)
            frames += 1
            alarms += bool(faults)
            proven += checked and not faults
            if faults:
                click.echo(f"{where}: false alarm: {faults[0]}")
            if not _is_in_light(case):
                continue
            in_light += 1
            if faults or not checked:
                click.echo(f"{where}: in light, and not proven")
                continue
            proven_in_light += 1
            missed = []
            for name, image in _altered(cases, images, i).items():
                tried[name] += 1
                checks, beside = Remembering(scenarios, known), BESIDE if name in OF_OTHERS else 0
                if _compared(checks, cases, images, i, np.ascontiguousarray(image), beside)[1]:
                    found[name] += 1
                else:
                    missed.append(name)
            if missed:
                click.echo(f"{where}: missed: {', '.join(missed)}")
    click.echo(f"{frames} frames, {proven} proven, {alarms} false alarms")
    click.echo(f"{in_light} in light, of which {proven_in_light / max(in_light, 1):.1%} proven")
    for name, count in tried.items():
        click.echo(f"{name:30s} {found[name]:5d} of {count:5d}, {found[name] / count:.1%}")
    click.echo(f"{time.process_time() - start_s:.0f} s")


def _altered(cases: list[Case], images: list[AnyArray], i: int) -> dict[str, AnyArray]:
    """The picture of a frame in each of the ways that change it."""
    altered = {name: alter(images, i) for name, alter in ALTERED.items()}
    for name, later in OF_OTHERS.items():
        j = (i + later) % len(cases)
        if _moved_px(cases[i], cases[j]) >= MOVED_PX:
            altered[name] = images[j]
    if images[i].ndim == 3:
        altered |= {name: images[i][..., order] for name, order in CHANNELS.items()}
    return altered


def _moved_px(one: Case, other: Case) -> float:
    """By how much the target's vertices are elsewhere in another frame."""
    places = [each.camera.project(each.target.vertices_m()) for each in (one, other)]
    return float(np.sqrt(np.nanmean(np.sum((places[0] - places[1]) ** 2, axis=1))))


def _is_in_light(case: Case) -> bool:
    """Whether the Sun lights enough of the target for its picture to show it."""
    labels = case.labels
    lit_px = (labels.fraction_lit or 0.0) * labels.mask_area_px
    return labels.sun_fraction_target >= LEAST_SUNLIGHT and lit_px >= LEAST_LIT_PX


def _compared(
    checks: Remembering, cases: list[Case], images: list[AnyArray], i: int, image: AnyArray, beside: int
) -> tuple[int, list[str]]:
    """Whether a frame proves something, and its faults; so many frames beside it are as they are."""
    checked = 0
    for near in range(max(i - beside, 0), min(i + beside + 1, len(cases))):
        before = checks.results[0].checked
        checks.compare(cases[near], image if near == i else images[near])
        if near == i:
            checked = checks.results[0].checked - before
    index = cases[i].labels.index
    faults = [
        fault.message for result in checks.results for fault in result.faults if fault.frame == index
    ]
    return checked, faults


if __name__ == "__main__":
    main()
