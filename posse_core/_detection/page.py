"""The page of an evaluation: tables, precision over recall, errors over range, the worst frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np
from markupsafe import Markup

from posse_core._dataset.images import LabelledImages
from posse_core._detection.draw import draw
from posse_core._detection.evaluate import Judged, JudgedBody, PoseErrors
from posse_core._detection.glossary import meanings
from posse_core._detection.groups import Group, columns, trusts
from posse_core._evaluation.metrics import precision_by_recall
from posse_core._evaluation.numbers import number
from posse_core._evaluation.pages import (
    Axis,
    Series,
    heading,
    jpeg,
    page,
    paragraph,
    plot,
    strip,
    table,
)
from posse_core._imaging.grey import to_grey

_WORST = 12
_TRUST_BINS = 10
_THUMBNAIL_PX = 320
_WHITE = (255, 255, 255)


def make_page(
    title: str, summary: str, dataset: LabelledImages, judged: Sequence[Judged], groups: Sequence[Group]
) -> str:
    """Return the HTML page of an evaluation.

    Args:
        title, summary: plain text that says what was measured.
        dataset: of the frames.
        judged: the evaluated frames.
        groups: of ``judged``, all frames first.
    """
    of_boxes, of_poses = columns(groups)
    body = [heading("Boxes"), _table(groups, of_boxes)]
    if of_poses:
        body += [heading("Poses"), _table(groups, of_poses)]
    body += [heading("What the columns mean"), table(("", ""), meanings([*of_boxes, *of_poses]))]
    body += [heading("Precision by recall"), *_precision(dataset, judged)]
    told = trusts(judged)
    if told:
        body += [heading("Trust"), *_trust(told)]
    if judged[0].labels.has("range_m"):
        body += [heading("By range"), *_by_range(judged)]
    body += [heading("Worst frames"), *_worst(dataset, judged)]
    return page(title, summary, body)


def _table(groups: Sequence[Group], names: Sequence[str]) -> Markup:
    rows = [
        [group.name, str(group.frames), *(number(group.metrics.get(name)) for name in names)]
        for group in groups
    ]
    return table(("", "frames", *names), rows)


def _precision(dataset: LabelledImages, judged: Sequence[Judged]) -> Iterator[Markup]:
    truths, detections = [j.truths for j in judged], [j.detections for j in judged]
    curves = precision_by_recall(truths, detections, sorted(dataset.classes))
    recall = np.linspace(0, 1, 101).tolist()
    for name, by_overlap in curves.items():
        series = [
            Series(f"{iou:.2f}", list(zip(recall, precision.tolist(), strict=True)), line=True)
            for iou, precision in by_overlap.items()
        ]
        yield plot(f"precision of {name}, by IoU", Axis("recall", 0, 1), Axis("", 0, 1), series)


def _trust(told: Sequence[tuple[float, bool]]) -> Iterator[Markup]:
    trust, right = (np.array(column) for column in zip(*told, strict=True))
    lows = np.arange(_TRUST_BINS) / _TRUST_BINS
    members = [(trust >= low) & ((trust < low + 1 / _TRUST_BINS) | (low == lows[-1])) for low in lows]
    bins = [(float(trust[m].mean()), float(right[m].mean())) for m in members if m.any()]
    ideal = Series("honest", [(0.0, 0.0), (1.0, 1.0)], line=True)
    axis = Axis("trust, mean of each tenth", 0, 1)
    yield plot("share of right poses", axis, Axis("", 0, 1), [ideal, Series("measured", bins)])
    if right.all() or not right.any():
        return
    order = np.argsort(-trust, kind="stable")
    kept = [np.append(0, np.cumsum(each[order]) / each.sum()) for each in (~right, right)]
    curve = Series("by trust", list(zip(*(k.tolist() for k in kept), strict=True)), line=True)
    axis = Axis("share of wrong poses that are kept", 0, 1)
    yield plot("share of right poses that are kept", axis, Axis("", 0, 1), [curve])


def _by_range(judged: Sequence[Judged]) -> Iterator[Markup]:
    bodies = [body for j in judged for body in j.bodies]
    everyone = [body for j in judged for body in j.labels.instances.values()]
    ranges = Axis.over("range, m", [body.range_m for body in everyone])
    found = _by_class(bodies, lambda body: body.overlap)
    yield plot("box IoU with the best detection of the class", ranges, Axis("IoU", 0, 1), found)
    measures: dict[str, Callable[[PoseErrors], float]] = {
        "position error / range": lambda pose: pose.e_t,
        "attitude error, degrees": lambda pose: float(np.degrees(pose.e_q_rad)),
        "ADD / diameter": lambda pose: pose.add,
    }
    posed = [body for body in bodies if body.pose is not None]
    for name, measure in measures.items() if posed else ():

        def value(body: JudgedBody, measure: Callable[[PoseErrors], float] = measure) -> float:
            assert body.pose is not None
            return max(measure(body.pose), 1e-6)  # so that errors of 0 are on the logarithmic axis

        axis = Axis.over("", map(value, posed), log=True)
        yield plot(name, ranges, axis, _by_class(posed, value))


def _by_class(bodies: Sequence[JudgedBody], value: Callable[[JudgedBody], float]) -> list[Series]:
    names = sorted({body.truth.label for body in bodies})
    return [
        Series(name, [(body.labels.range_m, value(body)) for body in bodies if body.truth.label == name])
        for name in names
    ]


def _worst(dataset: LabelledImages, judged: Sequence[Judged]) -> Iterator[Markup]:
    yield paragraph(
        "White: the label. Colour: the detection. Pictures show the square root of the grey values."
    )
    shown = sorted((j for j in judged if j.bodies), key=_least_overlap)
    yield _strip(dataset, "smallest overlap", shown[:_WORST], lambda j: f"IoU {_least_overlap(j):.2f}")
    empty = [j for j in judged if not j.bodies and j.detections]
    empty.sort(key=lambda j: -j.detections[0].score)
    if empty:
        yield _strip(
            dataset,
            "highest score without a spacecraft",
            empty[:_WORST],
            lambda j: f"score {j.detections[0].score:.2f}",
        )
    adds = {
        j.labels.index: max(found)
        for j in judged
        if (found := [body.pose.add for body in j.bodies if body.pose is not None])
    }
    worst = sorted((j for j in judged if j.labels.index in adds), key=lambda j: -adds[j.labels.index])
    if worst:
        yield _strip(
            dataset, "largest ADD", worst[:_WORST], lambda j: f"ADD {adds[j.labels.index]:.2g} d"
        )


def _least_overlap(judged: Judged) -> float:
    return min(body.overlap for body in judged.bodies)


def _strip(
    dataset: LabelledImages, title: str, judged: Sequence[Judged], words: Callable[[Judged], str]
) -> Markup:
    captions = [f"frame {j.labels.index}, {words(j)}" for j in judged]
    return strip(title, captions, [_thumbnail(dataset, j) for j in judged])


def _thumbnail(dataset: LabelledImages, judged: Judged) -> bytes:
    light = np.sqrt(to_grey(dataset.image(dataset.position(judged.labels.index))))
    scale = _THUMBNAIL_PX / max(light.shape)
    size = round(light.shape[1] * scale), round(light.shape[0] * scale)
    small = cv2.resize(light, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST)
    best = [replace(d, box_px=d.box_px * scale) for d in judged.detections[: max(1, len(judged.bodies))]]
    canvas = draw(np.round(255 * small).astype(np.uint8), best, sorted(dataset.classes))
    for truth in judged.truths:
        x, y, width, height = np.round(truth.box_px * scale).astype(int).tolist()
        cv2.rectangle(canvas, (x, y), (x + width, y + height), _WHITE, 1)
    return jpeg(canvas)
