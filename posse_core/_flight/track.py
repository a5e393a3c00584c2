"""Tracking a sequence: a navigator over the frames that a dataset already has."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from posse_core._arrays import FloatArray, array_fault
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import FLIGHT, TRACK, TRACK_PAGE, TRAJECTORY
from posse_core._detection.known import dataset_shapes
from posse_core._dynamics.plan import Burn
from posse_core._dynamics.start import Target
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.atomic import folder_of_result
from posse_core._files.flight import load_flight, save_flight
from posse_core._flight.chaser import as_known, start_error
from posse_core._flight.expected import expected
from posse_core._flight.eye import open_eye
from posse_core._flight.problem import thruster_errors
from posse_core._flight.record import flight_record, single_pose
from posse_core._flight.watch import Step, Watch
from posse_core._frames import matrix_from_quaternion, quaternion_from_matrix
from posse_core._interfaces.navigator import Estimate, NavigationProblem, Readings
from posse_core._model.flight_record import FlightRecord
from posse_core._model.trajectory import PLANE_TURN, Trajectory
from posse_core._plugins.registry import Registry
from posse_core._scenario.track import TrackConfig
from posse_core._view.flight.page import write_flight_page

Progress = Callable[[Iterable[Step], int], Iterable[Step]]
"""Wraps the steps to show progress: (steps, number of frames)."""


def track(
    dataset: Dataset,
    config: TrackConfig,
    registry: Registry,
    *,
    sequence: int | None,
    out: Path | None,
    progress: Progress,
) -> FlightRecord:
    """Track the target over one sequence of a dataset's frames.

    Impulses are those that ``flight.npz`` says were commanded; a dataset of no flight has none.

    Args:
        config: of measurements, navigator and start.
        sequence: its number; None for the only one.
        out: folder of the record and its page, made if it is not there; None writes nothing.
        progress: shows the progress.

    Raises:
        InputError: the sequence cannot be chosen or tracked, the trajectory has no orbit, a label that
            is needed was not made, or a model cannot be used.
        ComponentError: the navigator failed.
    """
    frames = frames_of(dataset, sequence)
    try:
        registry.options("navigator", config.navigator.name, config.navigator.options)
    except InputError as error:  # of the dataset's scenario, unless it was given
        raise InputError(f"{dataset.folder}: {error}") from None
    with contextlib.closing(_Tracking(dataset, frames, config, registry)) as tracking:
        record = flight_record(list(progress(tracking.steps(), len(frames))), None, np.nan)
    if out is not None:
        with folder_of_result(out):  # the page first: it reads all files of the dataset
            write_flight_page(dataset, record, out / TRACK_PAGE, positions=frames)
            save_flight(record, out / TRACK)
    return record


def frames_of(dataset: Dataset, sequence: int | None) -> list[int]:
    """Positions of the frames of one sequence, in order of time.

    Args:
        sequence: its number; None for the only one.

    Raises:
        InputError: there are several sequences and none is named, or none of this number; or its frames
            are not two or more at instants of their own.
    """
    rows = len(dataset.trajectory)
    if not len(dataset) or dataset.indices[-1] >= rows:
        raise InputError(
            f"{dataset.folder}: has {len(dataset)} frames, and its trajectory {rows} rows; see"
            " 'posse validate'"
        )
    numbers = dataset.trajectory.sequence[dataset.indices]
    there = np.unique(numbers)
    if sequence is None and len(there) > 1:
        raise InputError(
            f"{dataset.folder}: has {len(there)} sequences, {there[0]} to {there[-1]}; name one by"
            " --sequence"
        )
    if sequence is not None and sequence not in there:
        raise InputError(
            f"--sequence {sequence}: {dataset.folder} has the sequences {there[0]} to {there[-1]}"
        )
    positions = np.flatnonzero(numbers == (there[0] if sequence is None else sequence))
    t_s = dataset.trajectory.t_s[dataset.indices[positions]]
    order = np.argsort(t_s, kind="stable")
    if len(positions) < 2 or np.any(np.diff(t_s[order]) <= 0):
        raise InputError(
            f"{dataset.folder}: sequence {numbers[positions[0]]} has {len(positions)} frame(s) at"
            f" {len(np.unique(t_s))} instant(s); a navigator needs two or more, one after another"
        )
    return [int(position) for position in positions[order]]


@dataclass(frozen=True)
class _Impulses:
    """The instants (F,) until which readings are awaited, and the impulses then, (F, 3) m/s, RTN."""

    t_s: FloatArray
    commanded_rtn_m_s: FloatArray
    rtn_m_s: FloatArray


class _Tracking:
    def __init__(
        self, dataset: Dataset, frames: list[int], config: TrackConfig, registry: Registry
    ) -> None:
        self._dataset, self._frames, self._config = dataset, frames, config
        self._registry = registry
        self._rows = dataset.trajectory.rows(dataset.indices[frames])
        self._impulses = _impulses(dataset, frames, self._rows.t_s)
        refiner = config.measurement.refiner
        self._eye = open_eye(
            config.measurement,
            dataset.spacecraft,
            dataset.camera,
            config.seed,
            registry,
            None if refiner is None else dataset_shapes(dataset, registry, refiner),
            where="measurement",
        )

    def close(self) -> None:
        """Close what refines poses."""
        self._eye.close()

    def steps(self) -> Iterator[Step]:
        """Track, and yield each frame with what followed from it."""
        watch: Watch | None = None
        for i, position in enumerate(self._frames):
            row = self._rows.rows(np.array([i]))
            readings = self._read(position, row, watch)
            is_used = False
            if watch is None and (start := self._start(readings, row)) is not None:
                watch = self._watch(start)
                is_used = self._config.start == "first-pose"
            if watch is not None and not is_used:
                watch.read(readings, row)
            burn = Burn(float(self._impulses.t_s[i]), self._impulses.commanded_rtn_m_s[i])
            innovations = {} if watch is None else watch.deliver(burn.t_s)
            estimate = None if watch is None else watch.estimate(readings.t_s)
            if watch is not None and np.any(burn.dv_rtn_m_s):
                watch.burned(burn)
            yield Step(
                row,
                None,
                readings,
                estimate,
                innovations,
                burn.t_s,
                burn.dv_rtn_m_s,
                self._impulses.rtn_m_s[i],
            )

    def _read(self, position: int, row: Trajectory, watch: Watch | None) -> Readings:
        labels = self._dataset[position]
        sigma_deg, seed = self._config.errors.camera_attitude_deg, self._config.seed
        R_true = matrix_from_quaternion(row.q_eci_from_camera[0])
        R_known = as_known(R_true, sigma_deg, seed, labels.index)
        q_known = quaternion_from_matrix(R_known)
        estimate = None if watch is None else watch.estimate(float(row.t_s[0]))
        image = self._dataset.image(position)
        return self._eye.read(labels, image, q_known, expected(estimate, row, q_known))

    def _start(self, readings: Readings, row: Trajectory) -> Estimate | None:
        """What is known before the readings of a frame; None while nothing is."""
        sigmas = self._config.errors.start
        if self._config.start == "dispersed":
            error, sigma = start_error(sigmas, self._config.seed)
            rtn = np.concatenate([row.r_chaser_rtn_m[0], row.v_chaser_rtn_m_s[0]]) - error
            return Estimate(readings.t_s, rtn[:3], rtn[3:], np.diag(sigma**2))
        single = single_pose(readings, row)
        if single is None:
            return None
        covariance = np.diag(np.repeat([0.0, sigmas.velocity_m_s**2], 3))
        turned_rad = np.radians(self._config.errors.camera_attitude_deg)
        covariance[:3, :3] = single.covariance_m2
        covariance[:3, :3] += turned_rad**2 * (
            single.r_rtn_m @ single.r_rtn_m * np.eye(3) - np.outer(single.r_rtn_m, single.r_rtn_m)
        )
        return Estimate(readings.t_s, single.r_rtn_m, np.zeros(3), covariance)

    def _watch(self, start: Estimate) -> Watch:
        config, dataset, rows = self._config, self._dataset, self._rows
        target = Target(
            rows.r_target_eci_m[0],
            rows.v_target_eci_m_s[0],
            config.constants,
            t_s=float(rows.t_s[0]),
            where=f"{dataset.folder / TRAJECTORY}: the target",
            turns_plane=PLANE_TURN in rows.extras,
        )
        target.check(elliptic=False)
        craft = dataset.spacecraft
        problem = NavigationProblem(
            epoch=Epoch.from_iso(rows.epoch_utc),
            target=target,
            start=start,
            camera=dataset.camera,
            radius_m=float(np.linalg.norm(dataset.mesh().vertices_body_m, axis=1).max()),
            symmetries=np.reshape(np.array(craft.symmetries, dtype=np.float64), (-1, 3, 3)),
            inertia_kg_m2=None if config.inertia_kg_m2 is None else np.array(config.inertia_kg_m2),
            thrusters=thruster_errors(config.errors),
            camera_attitude_rad=float(np.radians(config.errors.camera_attitude_deg)),
            period_s=float(np.median(np.diff(rows.t_s))),
        )
        return Watch(config.navigator, self._registry, problem)


def _impulses(dataset: Dataset, frames: list[int], t_s: FloatArray) -> _Impulses:
    """The impulses of a flight; without one, none, and readings are awaited until the next frame."""
    path = dataset.folder / FLIGHT
    if path.exists():
        flown, indices = load_flight(path), dataset.indices[frames]
        whole = (flown.burn_s, flown.dv_commanded_rtn_m_s, flown.dv_rtn_m_s)
        count = len(dataset.trajectory)
        for array, shape in zip(whole, ((count,), (count, 3), (count, 3)), strict=True):
            if (fault := array_fault(array, shape, "floating")) is not None:
                raise InputError(
                    f"{path}: not the record of the dataset's frames: an array {fault}; resume the"
                    " flight, or make it again"
                )
        return _Impulses(*(array[indices] for array in whole))
    until_s = [after for _, after in pairwise(t_s.tolist())]
    nothing = np.zeros((len(t_s), 3))
    return _Impulses(np.array([*until_s, 2 * t_s[-1] - t_s[-2]]), nothing, nothing)
