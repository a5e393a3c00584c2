"""The functions of the public face: open, run, fly or track, open a detector, solve a pose."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import SCENARIO
from posse_core._detection.hypotheses import poses_of
from posse_core._detection.opening import open_pose_detector
from posse_core._detection.pnp import solve_pose
from posse_core._detection.pose_detector import LEAST_SCORE, PoseDetector
from posse_core._errors import ComponentError, InputError
from posse_core._interfaces.detector import Detection, PoseEstimate
from posse_core._model.camera import Camera
from posse_core._model.flight_record import FlightRecord
from posse_core._plugins.kinds import KINDS
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import nearest
from posse_core._run.plan import make_plan
from posse_core._run.run import run as make_dataset
from posse_core._scenario.component import ComponentChoice
from posse_core._scenario.load import load_scenario, scenario_members
from posse_core._scenario.model import Scenario
from posse_core._scenario.track import read_track_config
from posse_core._simulator.simulator import Simulator

ScenarioSource = str | Path | Mapping[str, Any]
"""A scenario: name of a built-in one, path of a YAML file, or a mapping with its keys."""


def open(
    scenario: ScenarioSource,
    *,
    renderer: str | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> Simulator:
    """Open a scenario as a simulator, in this process and without writing a file.

    Args:
        scenario: name of a built-in scenario, path of a YAML file, or a mapping with its keys.
        renderer: name of the renderer, instead of the scenario's.
        seed: of every random draw, instead of the scenario's.
        overrides: dotted key → value, instead of the scenario's, as in ``{"camera.width_px": 320}``.

    Raises:
        InputError: the scenario cannot be used; the message names the key and the way out.
        ComponentError: this machine lacks what the renderer needs.
    """
    registry = load_plugins().registry
    return Simulator(_loaded(scenario, renderer, seed, None, overrides), registry)


def run(
    scenario: ScenarioSource,
    out: str | Path,
    *,
    renderer: str | None = None,
    frames: int | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    workers: int = 1,
    resume: bool = False,
) -> Dataset:
    """Make the dataset of a scenario in worker processes, as ``posse run`` does.

    Args:
        scenario: as of :func:`open`.
        out: folder of the dataset.
        renderer: name of the renderer, instead of the scenario's.
        frames: make only so many of the scenario's frames, evenly spread.
        seed: of every random draw, instead of the scenario's.
        overrides: as of :func:`open`.
        workers: number of worker processes on this machine.
        resume: go on with the run in ``out``; only frames that are not there are made.

    Raises:
        InputError: the scenario cannot be used, or the folder cannot be, or holds another run.
        ComponentError: frames could not be made; those that could are in the folder.
    """
    plugins = load_plugins()
    checked = _loaded(scenario, renderer, seed, frames, overrides)
    options = plugins.registry.options("executor", "local", {"workers": workers}, where="run")
    result = make_dataset(
        make_plan(checked, plugins.registry),
        str(out),
        plugins,
        plugins.registry.create("executor", "local", options),
        resume=resume,
        progress=lambda results, *_: results,
    )
    if result.failed:
        index, error = min(result.failed.items())
        raise ComponentError(
            f"{out}: {len(result.failed)} of {result.frames} frames failed; frame {index}: {error}"
        )
    return Dataset(Path(out))


def fly(
    scenario: ScenarioSource,
    out: str | Path | None = None,
    *,
    renderer: str | None = None,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    resume: bool = False,
) -> FlightRecord:
    """Fly a scenario with the camera in the loop, in this process, as ``posse fly`` does.

    Args:
        scenario: as of :func:`open`, with the key ``flight``.
        out: folder of the flight's dataset; None writes nothing.
        renderer: name of the renderer, instead of the scenario's.
        seed: of every random draw, instead of the scenario's.
        overrides: as of :func:`open`.
        resume: go on with the flight in ``out``; the frames that are there are not rendered again.

    Raises:
        InputError: the scenario has no flight or one that cannot be flown, or the folder cannot be used.
        ComponentError: a component failed. The frames that were made are in the folder.
    """
    # Half a second to import, for statistics that only flights need.
    from posse_core._flight.fly import fly as flown

    return flown(
        _loaded(scenario, renderer, seed, None, overrides),
        None if out is None else str(out),
        load_plugins(),
        resume=resume,
        progress=lambda steps, _: steps,
    )


def track(
    dataset: str | Path | Dataset,
    *,
    navigator: str | None = None,
    sequence: int | None = None,
    out: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> FlightRecord:
    """Track the target over a dataset's frames, as ``posse track`` does.

    Args:
        dataset: made by :func:`run` or :func:`fly`, or its folder.
        navigator: its name, instead of the flight's or ``ekf``.
        sequence: number of the relative orbit; None for the only one.
        out: folder of the record and its page; None writes nothing.
        overrides: dotted key → value, as in ``{"measurement.source": "truth"}``; ``posse describe
            track`` lists the keys.

    Returns:
        Its rows are in order of time. It has no waypoints, and impulses only where the dataset is of a
        flight.

    Raises:
        InputError: the sequence cannot be chosen or tracked, a key or value is not valid, the
            trajectory has no orbit, a label that is needed was not made, or a model cannot be used.
        ComponentError: the navigator failed.
    """
    # Half a second to import, as for flights.
    from posse_core._flight.track import track as tracked

    source = dataset if isinstance(dataset, Dataset) else Dataset(dataset)
    given = dict(overrides or {})
    if navigator is not None:
        given["navigator.name"] = navigator
    return tracked(
        source,
        read_track_config(source.folder / SCENARIO, given),
        load_plugins().registry,
        sequence=sequence,
        out=_path(out),
        progress=lambda steps, _: steps,
    )


def detector(
    boxes: str | Path | None = None,
    keypoints: str | Path | None = None,
    *,
    least_score: float = LEAST_SCORE,
    options: Mapping[str, Any] | None = None,
    target: str | Path | None = None,
    refine: str | Mapping[str, Any] | None = None,
) -> PoseDetector:
    """A detector of spacecraft and their poses, from model files or, without any, the shipped models.

    Args:
        boxes: file of the model that finds spacecraft, ``.safetensors`` or ``.onnx``; None is the
            shipped one of the target, or else of Aqua and Cluster.
        keypoints: file of the model that finds their keypoints; None is the shipped one where ``boxes``
            is None too, else none, and there are no poses.
        least_score: detections below it are left out, 0 … 1; a third of it is enough where the pose is
            trusted.
        options: of the components that read the models, as in ``{"threads": 1}``.
        target: the only spacecraft to find: the name that the model gives it, or the folder of its
            package; None finds all that the model knows. The mesh of the package, or of the installed
            spacecraft of that name, gives boxes and refined poses.
        refine: name of the refiner of poses, such as ``render-compare``, or a mapping of ``name`` and
            its options; None refines none.

    Raises:
        InputError: a file is missing or not such a model, or no installed plugin ships one; or the model
            does not know the target.
    """
    return open_pose_detector(
        _path(boxes),
        _path(keypoints),
        load_plugins().registry,
        options or {},
        target=None if target is None else str(target),
        refiner=None if refine is None else ComponentChoice.model_validate(refine),
        least_score=least_score,
    )


def pose(
    points_body_m: ArrayLike, points_px: ArrayLike, camera: Camera, sigma_px: ArrayLike = 1.0
) -> PoseEstimate | None:
    """The pose that brings points of the body to pixels, with its covariance.

    RANSAC by P3P (Ke and Roumeliotis 2017), then weighted least squares with Huber's weights.

    Args:
        points_body_m: (K, 3) metres, body frame.
        points_px: (K, 2) pixels, the centre of the top-left pixel at (0, 0).
        camera: that sees them, with its lens.
        sigma_px: (K,) standard deviation of each coordinate, or one for all.

    Returns:
        None where fewer than four points are given or agree on a pose.

    Raises:
        InputError: shapes that do not fit, or a number that is not finite.
    """
    body_m, px = np.asarray(points_body_m, np.float64), np.asarray(points_px, np.float64)
    if body_m.ndim != 2 or body_m.shape[1] != 3 or px.shape != (len(body_m), 2):
        raise InputError(
            f"pose: points_body_m is {body_m.shape} and points_px {px.shape};"
            " (K, 3) and (K, 2) are needed"
        )
    sigma = np.asarray(sigma_px, np.float64)
    if sigma.shape not in ((), (len(body_m),)):
        raise InputError(f"pose: sigma_px is {sigma.shape}; one number is needed, or one for each point")
    sigma = np.broadcast_to(sigma, len(body_m))
    if not (np.isfinite(body_m).all() and np.isfinite(px).all() and (sigma > 0).all()):
        raise InputError("pose: a point is not finite, or a standard deviation not above 0")
    return solve_pose(body_m, px, sigma, camera)


def poses(points_body_m: ArrayLike, found: Detection, camera: Camera) -> list[PoseEstimate]:
    """The poses on which the keypoints of a detection may agree, most likely first.

    There are several where the spacecraft looks alike from several sides, and its keypoints may each be
    at several places. Poses of three keypoints at a time (P3P, Ke and Roumeliotis 2017) are compared by
    the likelihood of all places, and those that clearly differ are fitted by weighted least squares.

    Args:
        points_body_m: (K, 3) metres, body frame; NaN where a keypoint has no fixed place.
        found: with keypoints, as of :meth:`posse_core.KeypointFinder.find`.
        camera: that sees them, with its lens.

    Returns:
        The poses, each with the keypoints that fit it as its ``detection``; none where fewer than four
        keypoints agree on one. Their ``certainty`` is the probability of each among them.

    Raises:
        InputError: shapes that do not fit.
    """
    body_m, px = np.asarray(points_body_m, np.float64), found.keypoints_px
    if px is None or body_m.shape != (len(px), 3):
        raise InputError(
            f"poses: points_body_m is {body_m.shape}, and the detection has"
            f" {'no' if px is None else len(px)} keypoints; one point for each is needed"
        )
    return poses_of(body_m, found, camera)


def create(kind: str, name: str, **options: Any) -> Any:
    """A component by its kind and name, as in ``create("renderer", "raster", samples_per_axis=2)``.

    Args:
        kind: ``propagator``, ``attitude-law``, ``joint-law``, ``scene``, ``renderer``, ``annotator``,
            ``detector``, ``refiner``, ``navigator``, ``controller``, ``writer`` or ``executor``.
        options: of the component; ``posse describe KIND NAME`` lists them.

    Raises:
        InputError: no such kind, name or option; the message names what there is.
        ComponentError: the component cannot be imported or made.
    """
    if kind not in KINDS:
        hint = nearest(kind, KINDS) or "."
        raise InputError(f"no kind of component named {kind!r}{hint} There are {', '.join(KINDS)}")
    registry = load_plugins().registry
    return registry.create(kind, name, registry.options(kind, name, options))


def _path(name: str | Path | None) -> Path | None:
    return None if name is None else Path(name)


def _loaded(
    source: ScenarioSource,
    renderer: str | None,
    seed: int | None,
    frames: int | None,
    overrides: Mapping[str, Any] | None,
) -> Scenario:
    named = {"renderer.name": renderer, "seed": seed, "frames": frames}
    given = {key: value for key, value in named.items() if value is not None}
    if not isinstance(source, Mapping):
        members = scenario_members(str(source))
        if len(members) > 1:
            names = ", ".join(member.source for member in members)
            raise InputError(f"{source}: a collection; name one of its scenarios: {names}")
        source, given = members[0].source, {**members[0].overrides, **(overrides or {}), **given}
        return load_scenario(source, load_plugins().registry, given)
    return load_scenario(source, load_plugins().registry, {**(overrides or {}), **given})
