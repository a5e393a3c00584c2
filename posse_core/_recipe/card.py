"""The model card of a recipe: what the models know, how well, and what they do not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from posse_core import __version__
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import PARTS
from posse_core._detection.card import ModelCard
from posse_core._detection.groups import Group
from posse_core._detection.pose_detector import LEAST_SCORE
from posse_core._evaluation.numbers import number
from posse_core._files.atomic import sha256, write_bytes
from posse_core._recipe.budget import Decision
from posse_core._recipe.judging import PAGE, PART, PICTURES, Evaluation
from posse_core._recipe.model import Recipe
from posse_core._recipe.scenarios import CRAFT, Scenarios
from posse_core._recipe.steps import Note
from posse_core._recipe.training import MODEL

CARD: Final = "card.md"
_COLUMNS: Final = {
    "mAP": "mAP",
    "mAP50": "mAP50",
    "box IoU median": "overlap, median",
    "poses estimated": "poses estimated",
    "e_t median": "e_t, median",
    "e_q median, deg": "e_q, median, deg",
    "e_t before": "e_t before refinement",
    "e_q before, deg": "e_q before, deg",
    "refined": "refined",
    "SPEED 2019": "SPEED",
}


def write_card(
    folder: Path,
    scenarios: Scenarios,
    decision: Decision,
    epochs: Mapping[str, int],
    evaluation: Evaluation,
    dataset: Dataset,
    notes: Mapping[str, Note],
    models: Sequence[Path],
) -> None:
    """Write :data:`CARD` in Markdown.

    Args:
        folder: of the recipe.
        scenarios: of the recipe.
        decision: how many frames, and what was expected.
        epochs: task → number of epochs.
        evaluation: of the test part.
        dataset: that the models learned from.
        notes: of the steps.
        models: the exported files.
    """
    recipe = scenarios.recipe
    lines = [
        *_head(recipe, dataset),
        *_models(recipe, folder, epochs, models),
        *_data(recipe, dataset, decision),
        *_accuracy(evaluation, len(dataset.part(PART))),
        *_limits(scenarios, evaluation),
        *_time(recipe, decision, notes),
    ]
    write_bytes(folder / CARD, ("\n".join(lines) + "\n").encode())


def _head(recipe: Recipe, dataset: Dataset) -> Iterator[str]:
    craft = dataset.spacecraft
    of = recipe.craft.options.get("mesh", recipe.craft.options.get("package", recipe.craft.name))
    yield f"# Pose of {craft.name}"
    yield ""
    yield (
        f"Two nets that find {craft.name} in a grey or colour image and {len(craft.keypoints_body_m)}"
        " keypoints on it, from which its pose follows. They were trained on images made by POSSE"
        f" {__version__} alone, from `{Path(str(of)).name}`, by `recipe.yaml`."
    )
    yield ""
    yield "```sh"
    target = CRAFT if recipe.craft.name == "mesh" else craft.name
    yield (
        "posse detect IMAGES --model boxes.onnx --keypoints keypoints.onnx --camera CAMERA"
        f" --target {target}{'' if recipe.refiner is None else ' --refine'}"
    )
    yield "```"
    yield ""


def _models(
    recipe: Recipe, folder: Path, epochs: Mapping[str, int], models: Sequence[Path]
) -> Iterator[str]:
    yield "## Models"
    yield ""
    rows = [
        [f"`{path.name}`", recipe.nets[task].name, str(epochs[task]), f"`{sha256(path)}`"]
        for task, path in zip(recipe.nets, models, strict=True)
    ]
    yield from _table(["file", "net", "epochs", "SHA-256"], rows)
    for task in recipe.nets:
        start = ModelCard.read(folder / task / MODEL).options.get("start")
        if start is not None:
            yield f"The training of {task} began with the weights of another net: {start}."
            yield ""


def _data(recipe: Recipe, dataset: Dataset, decision: Decision) -> Iterator[str]:
    yield "## Data"
    yield ""
    parts = ", ".join(f"{len(dataset.part(part))} {part}" for part in PARTS)
    dropped = sum(rule.dropped for rule in dataset.manifest.selection or ())
    yield (
        f"{len(dataset)} frames ({parts}); {dropped} of {sum(decision.frames.values())} were dropped"
        f" ({', '.join(recipe.data.drop) or 'no rule'}). SHA-256 `{dataset.sha256}`."
    )
    yield ""
    kept = [labels.origin[0] for labels in dataset]
    rows = []
    for source in dataset.manifest.sources or ():
        shown = "yes" if recipe.data.sources[source.dataset].craft else "no"
        renderer = str((source.renderer or {}).get("name", "-"))
        rows.append([source.dataset, renderer, shown, str(kept.count(source.dataset))])
    yield from _table(["source", "renderer", "shows the spacecraft", "frames"], rows)


def _accuracy(evaluation: Evaluation, frames: int) -> Iterator[str]:
    taken = evaluation.groups[0].frames
    some = "" if taken == frames else f"{taken} of the {frames} frames of "
    yield "## Accuracy"
    yield ""
    yield (
        f"On {some}the test part, which no training saw. `{PAGE}` has curves and the worst frames,"
        f" `{PICTURES}` pictures; `posse eval --help` explains the columns."
    )
    yield ""
    columns = [name for name in _COLUMNS if any(name in g.metrics for g in evaluation.groups)]
    rows = [_row(group, columns) for group in evaluation.groups]
    yield from _table(["", "frames", *(_COLUMNS[name] for name in columns)], rows)
    if evaluation.without_craft:
        share = evaluation.found_without_craft / evaluation.without_craft
        yield (
            f"In {evaluation.found_without_craft} of {evaluation.without_craft} frames without a"
            f" spacecraft ({share:.1%}) something was detected with a score of at least {LEAST_SCORE}."
        )
        yield ""


def _row(group: Group, columns: Sequence[str]) -> list[str]:
    return [group.name, str(group.frames), *(number(group.metrics.get(name), 3) for name in columns)]


def _limits(scenarios: Scenarios, evaluation: Evaluation) -> Iterator[str]:
    recipe, camera = scenarios.recipe, scenarios.camera
    nearest_m, farthest_m = scenarios.ranges_m
    smallest, largest = recipe.data.apparent_size
    yield "## Limits"
    yield ""
    yield (
        f"- Apparent sizes from {smallest:g} to {largest:g} of the image's height, which is"
        f" {nearest_m:.3g} to {farthest_m:.3g} m with the training's camera ({camera.width_px} ×"
        f" {camera.height_px} px, focal length {camera.fy_px:.4g} px). The pose follows from the camera"
        " that is given; the nets do not depend on it."
    )
    yield "- Sunlit spacecraft; none of the frames is in eclipse."
    yield "- One spacecraft in an image, nothing beside it, joints as the recipe's scenario has them."
    yield "- Not tried on real photographs: the test part is made like the rest."
    if not evaluation.without_craft:
        yield "- Images without a spacecraft were not in the test part."
    yield ""


def _time(recipe: Recipe, decision: Decision, notes: Mapping[str, Note]) -> Iterator[str]:
    yield "## Time"
    yield ""
    rows = [
        [
            name,
            number(note.seconds / 60, 3),
            number(x / 60, 3) if (x := decision.expected_s.get(name)) is not None else "-",
        ]
        for name, note in notes.items()
    ]
    total_h = sum(note.seconds for note in notes.values()) / 3600
    asked = "" if recipe.hours is None else f" of {recipe.hours:g} h"
    yield f"{total_h:.2f} h{asked} with {recipe.workers} workers, without attempts that were stopped."
    yield ""
    yield from _table(["step", "minutes", "expected"], rows)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(header)} |"
    yield f"|{'---|' * len(header)}"
    for row in rows:
        yield f"| {' | '.join(row)} |"
    yield ""
