"""How sure ``posse validate`` is of pictures: ``python benchmarks/pictures.py FOLDER...``.

Every picture of the datasets is compared with its labels as it is, and altered in each of some ways.
What is printed are the frames that prove something, the false alarms, and the share of the alterations
that are found in the former.
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
from posse_core._evaluation.pictures import PictureChecks, Subject
from posse_core._evaluation.scenarios import Scenarios

Altered = Callable[[list[AnyArray], int], AnyArray]
ALTERED: dict[str, Altered] = {
    "shifted by 2 px": lambda images, i: np.roll(images[i], 2, axis=1),
    "shifted by 2 px down": lambda images, i: np.roll(images[i], 2, axis=0),
    "shifted by 10 px": lambda images, i: np.roll(images[i], 10, axis=1),
    "mirrored": lambda images, i: images[i][:, ::-1],
    "turned by 180°": lambda images, i: images[i][::-1, ::-1],
    "of the next frame": lambda images, i: images[(i + 1) % len(images)],
    "of another frame": lambda images, i: images[(i + 7) % len(images)],
    "black": lambda images, i: np.zeros_like(images[i]),
}


class Remembering(PictureChecks):
    """Checks that compute only once what a frame's pictures are compared with."""

    def __init__(self, scenarios: Scenarios, known: dict[int, Subject]) -> None:
        super().__init__(scenarios)
        self._known = known

    def subject(self, case: Case) -> Subject:
        """What a frame's picture is compared with."""
        index = case.labels.index
        if index not in self._known:
            self._known[index] = super().subject(case)
        return self._known[index]


@click.command()
@click.argument("folders", type=click.Path(path_type=Path), nargs=-1, required=True)
def main(folders: tuple[Path, ...]) -> None:
    """Compare the pictures of datasets in FOLDERS."""
    found: Counter[str] = Counter()
    frames = proven = alarms = 0
    start_s = time.process_time()
    for folder in folders:
        dataset = Dataset(folder)
        scenarios = Scenarios(dataset)
        cases = [Case(dataset, labels) for labels in dataset]
        images = [read_image(folder / case.labels.image) for case in cases]
        known: dict[int, Subject] = {}
        sure = set()
        for i, case in enumerate(cases):
            frames += 1
            checked, faults = _compared(Remembering(scenarios, known), cases, images, i, images[i])
            if faults:
                alarms += 1
                click.echo(f"{folder} frame {case.labels.index}: {faults[0]}")
            elif checked:
                sure.add(i)
        proven += len(sure)
        for name, alter in ALTERED.items():
            for i in sorted(sure):
                altered = np.ascontiguousarray(alter(images, i))
                found[name] += bool(
                    _compared(Remembering(scenarios, known), cases, images, i, altered)[1]
                )
    click.echo(f"{frames} frames, {proven} prove something, {alarms} false alarms")
    for name in ALTERED:
        click.echo(f"{name:22s} {found[name]:5d} found, {found[name] / max(proven, 1):.1%}")
    click.echo(f"{time.process_time() - start_s:.0f} s")


def _compared(
    checks: Remembering, cases: list[Case], images: list[AnyArray], i: int, image: AnyArray
) -> tuple[int, list[str]]:
    """Whether a frame proves something, and its faults; the frames beside it are there as they are."""
    checked = 0
    for near in range(max(i - 1, 0), min(i + 2, len(cases))):
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
