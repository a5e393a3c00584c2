"""One HTML file that shows a flight: key figures, the path, errors over time, the frames to replay."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.flight import flight_errors, summarise
from posse_core._evaluation.track import summarise_track
from posse_core._model.flight_record import FlightRecord
from posse_core._view.document import VIEWER_SCRIPTS, Document, Page
from posse_core._view.flight.columns import as_numbers, camera_poses, in_space, time_plots
from posse_core._view.flight.figures import key_figures

MAX_BYTES = 64 * 2**20
"""Largest size of a page, as that of ``posse view``."""
_SCRIPTS = (
    *VIEWER_SCRIPTS,
    "flight/pose.js",
    "player.js",
    "flight/timeplot.js",
    "flight/projection.js",
    "flight/flight.js",
)
_STYLES = ("page.css", "flight/flight.css")


def write_flight_page(
    dataset: Dataset,
    record: FlightRecord,
    path: Path,
    *,
    positions: Sequence[int] | None = None,
    max_bytes: int = MAX_BYTES,
) -> Page:
    """Write the page of a flight, or of a sequence that was tracked, never larger than ``max_bytes``.

    Previews are in it for all frames or, where they would not fit, for evenly spread ones; the page
    shows the dataset's own images where it finds them.

    Args:
        dataset: of the frames.
        record: of the same flight or sequence.
        path: of the page.
        positions: of the frames of a sequence; None for all frames of a flight.

    Raises:
        InputError: the record is of other frames than the dataset, the page would be too large without
            any preview, or a file of the dataset cannot be read.
    """
    tracked = positions is not None
    if positions is None:
        positions = range(len(dataset))
    numbered = tracked or np.array_equal(dataset.indices, np.arange(len(record)))
    if not len(record) or len(positions) != len(record) or not numbered:
        raise InputError(
            f"{dataset.folder}: has {len(positions)} frames, but the record of the flight {len(record)};"
            " make the flight again"
        )
    indices = dataset.indices[list(positions)]
    trajectory = dataset.trajectory.rows(indices)
    poses = {
        "true": camera_poses(trajectory, record.r_true_rtn_m, record.q_true_eci_from_body),
        "estimate": camera_poses(trajectory, record.r_rtn_m, record.q_eci_from_body),
        "single": camera_poses(trajectory, record.r_single_rtn_m, record.q_single_eci_from_body),
    }
    row_of = {index: row for row, index in enumerate(indices.tolist())}
    symmetries = dataset.spacecraft.symmetries
    flight = {
        "title": f"{'Tracking' if tracked else 'Flight'} {dataset.folder.resolve().name}",
        "figures": key_figures(
            record, summarise(record, symmetries), summarise_track(record, symmetries)
        ),
        "plots": [plot.as_json() for plot in time_plots(record, flight_errors(record, symmetries))],
        "wire": _wire(dataset),
        **in_space(record),
    }
    document = Document(
        dataset,
        positions,
        "flight/flight.html",
        _STYLES,
        _SCRIPTS,
        {"flight": flight},
        lambda index: {"poses": {name: pose.at(row_of[index]) for name, pose in poses.items()}},
    )
    way_out = "take fewer frames"
    return document.write(path, max_bytes=max_bytes, way_out=way_out, progress=_unseen)


def _unseen(positions: Iterable[int], frames: int) -> Iterable[int]:
    return positions


def _wire(dataset: Dataset) -> dict[str, Any]:
    """Lines that stand for the spacecraft: its skeleton or, where it has none, the box of its mesh.

    ``lines`` are pairs of positions in ``points_body_m``.
    """
    craft = dataset.spacecraft
    if craft.skeleton:
        names = list(craft.keypoints_body_m)
        points = np.array(list(craft.keypoints_body_m.values()))
        lines = [(names.index(a), names.index(b)) for a, b in craft.skeleton]
    else:
        vertices = dataset.mesh().vertices_body_m
        points = np.array(list(product(*zip(vertices.min(axis=0), vertices.max(axis=0), strict=True))))
        lines = [(a, a | bit) for bit in (1, 2, 4) for a in range(8) if not a & bit]
    return {"points_body_m": as_numbers(points), "lines": lines}
