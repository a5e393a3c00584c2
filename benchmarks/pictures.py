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
from posse_core._evaluation.pictures import PictureChecks
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
        sure = set()
        for i, case in enumerate(cases):
            frames += 1
            checked, faults = _compared(scenarios, cases, images, i, images[i])
            if faults:
                alarms += 1
                click.echo(f"{folder} frame {case.labels.index}: {faults[0]}")
            elif checked:
                sure.add(i)
        proven += len(sure)
        for name, alter in ALTERED.items():
            for i in sorted(sure):
                altered = np.ascontiguousarray(alter(images, i))
                found[name] += bool(_compared(scenarios, cases, images, i, altered)[1])
    click.echo(f"{frames} frames, {proven} prove something, {alarms} false alarms")
    for name in ALTERED:
        click.echo(f"{name:22s} {found[name]:5d} found, {found[name] / max(proven, 1):.1%}")
    click.echo(f"{time.process_time() - start_s:.0f} s")


def _compared(
    scenarios: Scenarios, cases: list[Case], images: list[AnyArray], i: int, image: AnyArray
) -> tuple[int, list[str]]:
    """Whether a frame proves something, and its faults; the frame before it is there as it is."""
    checks = PictureChecks(scenarios)
    if i:
        checks.compare(cases[i - 1], images[i - 1])
    before = [(result.checked, len(result.faults)) for result in checks.results]
    checks.compare(cases[i], image)
    results = checks.results
    faults = [
        fault.message
        for result, (_, n) in zip(results, before, strict=True)
        for fault in result.faults[n:]
    ]
    return results[0].checked - before[0][0], faults


if __name__ == "__main__":
    main()
