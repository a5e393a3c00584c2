"""From a propagator's motion to a trajectory: attitude and light added; a frame's state; files."""

from __future__ import annotations

import csv
import dataclasses
import io
import zipfile
from pathlib import Path

import numpy as np

from posse_core.attitude.camera import R_rtn_from_camera
from posse_core.attitude.target import R_eci_from_body, Surroundings
from posse_core.constants import Constants
from posse_core.dynamics.orbit import orbit_epoch
from posse_core.environment.earth import (
    R_cirs_from_gcrf,
    R_itrf_from_gcrf,
    earth_rotation_angle_rad,
)
from posse_core.environment.earthlight import earthlight_on_plate
from posse_core.environment.eclipse import solar_flux_w_m2, sun_angular_radius_rad, sun_fraction
from posse_core.environment.ephemeris import moon_eci_m, sun_eci_m
from posse_core.environment.time import Epoch
from posse_core.errors import InputError
from posse_core.files import atomic_file
from posse_core.frames import (
    R_eci_from_rtn,
    eci_from_rtn,
    matrix_from_quaternion,
    quaternion_from_matrix,
)
from posse_core.interfaces.propagator import PropagationProblem, Propagator
from posse_core.model.arrays import AnyArray
from posse_core.model.scene import FrameState
from posse_core.model.trajectory import Trajectory
from posse_core.scenario.attitude import AttitudeConfig


def build_trajectory(
    *,
    propagator: Propagator,
    problem: PropagationProblem,
    attitude: AttitudeConfig,
    seed: int,
) -> Trajectory:
    """Propagate, and add attitude and light. The same arguments give the same bits.

    Raises:
        InputError: the problem is outside the propagator's domain or the ephemeris, the target
            passes below the Earth's surface, or an attitude law is undetermined at a frame.
    """
    constants = problem.constants
    epoch = orbit_epoch(problem.orbit)
    motion = propagator.propagate(problem)
    r_target, v_target = motion.r_target_eci_m, motion.v_target_eci_m_s
    r_chaser, v_chaser = eci_from_rtn(r_target, v_target, motion.r_chaser_rtn_m, motion.v_chaser_rtn_m_s)
    tdb = epoch.tdb(motion.t_s)
    r_sun = sun_eci_m(*tdb)
    around = Surroundings(
        t_s=motion.t_s,
        r_target_eci_m=r_target,
        v_target_eci_m_s=v_target,
        r_sun_eci_m=r_sun,
        r_sun_epoch_eci_m=sun_eci_m(*epoch.tdb(np.zeros(()))),
        r_chaser_rtn_m=motion.r_chaser_rtn_m,
    )
    R_rtn_from_cam = R_rtn_from_camera(attitude.camera, motion.r_chaser_rtn_m, seed)
    tt = epoch.tt(motion.t_s)
    pole = R_cirs_from_gcrf(*tt)[..., 2, :]
    flux = solar_flux_w_m2(
        r_target, r_sun, solar_constant_w_m2=constants.solar_constant_w_m2, au_m=constants.au_m
    )
    earthlight = earthlight_on_plate(
        r_eci_m=r_target,
        normal_eci=-r_target,
        r_sun_eci_m=r_sun,
        earth_pole_eci=pole,
        jd_tt=tt[0] + tt[1],
        solar_flux_w_m2=flux,
        earth_radius_m=constants.earth_radius_m,
    )

    def fraction(r_eci_m: AnyArray) -> AnyArray:
        return sun_fraction(
            r_eci_m,
            r_sun,
            earth_radius_m=constants.earth_radius_m,
            sun_radius_m=constants.sun_radius_m,
            flattening=constants.eclipse_flattening,
            earth_pole_eci=pole,
        )

    return Trajectory(
        epoch_utc=epoch.iso(),
        t_s=motion.t_s,
        sequence=motion.sequence,
        r_target_eci_m=r_target,
        v_target_eci_m_s=v_target,
        r_chaser_rtn_m=motion.r_chaser_rtn_m,
        v_chaser_rtn_m_s=motion.v_chaser_rtn_m_s,
        r_chaser_eci_m=r_chaser,
        v_chaser_eci_m_s=v_chaser,
        q_eci_from_body=quaternion_from_matrix(R_eci_from_body(attitude.target, around)),
        q_eci_from_camera=quaternion_from_matrix(R_eci_from_rtn(r_target, v_target) @ R_rtn_from_cam),
        r_sun_eci_m=r_sun,
        r_moon_eci_m=moon_eci_m(*tdb),
        sun_fraction_target=fraction(r_target),
        sun_fraction_camera=fraction(r_chaser),
        solar_flux_w_m2=flux,
        earth_albedo_w_m2=earthlight.albedo_w_m2,
        earth_infrared_w_m2=earthlight.infrared_w_m2,
        earth_rotation_rad=earth_rotation_angle_rad(*epoch.ut1(motion.t_s)),
    )


def frame_state(trajectory: Trajectory, index: int, constants: Constants) -> FrameState:
    """What a renderer and the sky need of frame ``index``, 0 … F−1."""
    t_s = trajectory.t_s[index]
    epoch = Epoch.from_iso(trajectory.epoch_utc)
    tt = epoch.tt(t_s)
    r_target, r_sun = trajectory.r_target_eci_m[index], trajectory.r_sun_eci_m[index]
    R_eci_from_cam = matrix_from_quaternion(trajectory.q_eci_from_camera[index])
    R_rtn_to_eci = R_eci_from_rtn(r_target, trajectory.v_target_eci_m_s[index])
    return FrameState(
        index=index,
        t_s=float(t_s),
        epoch_jd_tt=float(tt[0] + tt[1]),
        R_cam_from_body=R_eci_from_cam.T @ matrix_from_quaternion(trajectory.q_eci_from_body[index]),
        # Not from the difference of the ECI positions, whose rounding is planetary.
        t_body_cam_m=-R_eci_from_cam.T @ R_rtn_to_eci @ trajectory.r_chaser_rtn_m[index],
        R_cam_from_eci=R_eci_from_cam.T,
        R_ecef_from_eci=R_itrf_from_gcrf(*tt, *epoch.ut1(t_s)),
        r_camera_eci_m=trajectory.r_chaser_eci_m[index],
        r_target_eci_m=r_target,
        r_sun_eci_m=r_sun,
        r_moon_eci_m=trajectory.r_moon_eci_m[index],
        solar_flux_w_m2=float(trajectory.solar_flux_w_m2[index]),
        sun_fraction_target=float(trajectory.sun_fraction_target[index]),
        sun_fraction_camera=float(trajectory.sun_fraction_camera[index]),
        sun_angular_radius_rad=float(sun_angular_radius_rad(r_target, r_sun, constants.sun_radius_m)),
    )


def save_trajectory(trajectory: Trajectory, path: Path) -> None:
    """Write ``.npz`` or ``.csv``, atomically.

    Both carry the fields of :class:`Trajectory` by name. The CSV has a row a frame; a vector's
    columns end in ``_x _y _z``, a quaternion's in ``_w _x _y _z``, and every number is read back to
    the bit.

    Raises:
        InputError: the name ends otherwise.
    """
    arrays = {name: getattr(trajectory, name) for name in _FIELDS}
    match path.suffix:
        case ".npz":
            with atomic_file(path) as stream:
                np.savez(stream, epoch_utc=np.array(trajectory.epoch_utc), **arrays)
        case ".csv":
            text = io.StringIO()
            rows = csv.writer(text, lineterminator="\n")
            rows.writerow(["epoch_utc", *(column for name in _FIELDS for column in _columns(name))])
            flat = [part for name in _FIELDS for part in arrays[name].reshape(len(trajectory), -1).T]
            for row in zip(*(part.tolist() for part in flat), strict=True):
                rows.writerow([trajectory.epoch_utc, *row])
            with atomic_file(path) as stream:
                stream.write(text.getvalue().encode())
        case _:
            raise _unknown_suffix(path)


def load_trajectory(path: Path) -> Trajectory:
    """Read what :func:`save_trajectory` wrote.

    Raises:
        InputError: the file is missing, of another kind, lacks a column, or has a value that is no
            finite number; the message names the file and the column.
    """
    if not path.is_file():
        raise InputError(f"there is no trajectory {path}; make one with 'posse propagate'")
    match path.suffix:
        case ".npz":
            epoch_utc, columns = _read_npz(path)
        case ".csv":
            epoch_utc, columns = _read_csv(path)
        case _:
            raise _unknown_suffix(path)
    arrays: dict[str, AnyArray] = {}
    for name in _FIELDS:
        parts = [columns[column] for column in _columns(name)]
        array = np.stack(parts, axis=-1) if len(parts) > 1 else parts[0]
        if not np.all(np.isfinite(array)):
            raise InputError(f"{path}: {name} has a value that is no finite number; mend that row")
        arrays[name] = array.astype(np.int64) if name == "sequence" else array
    if len(arrays["t_s"]) == 0:
        raise InputError(f"{path} has no frame")
    return Trajectory(epoch_utc=epoch_utc, **arrays)


_FIELDS = tuple(field.name for field in dataclasses.fields(Trajectory) if field.name != "epoch_utc")
_SUFFIXES = {"q": ("_w", "_x", "_y", "_z"), "r": ("_x", "_y", "_z"), "v": ("_x", "_y", "_z")}


def _columns(name: str) -> list[str]:
    """Names of the columns that a field takes in a CSV file."""
    return [name + suffix for suffix in _SUFFIXES.get(name.split("_")[0], ("",))]


def _read_npz(path: Path) -> tuple[str, dict[str, AnyArray]]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{path} is not a trajectory in NumPy's npz format: {error}") from None
    columns: dict[str, AnyArray] = {}
    for name in ("epoch_utc", *_FIELDS):
        if name not in arrays:
            raise InputError(f"{path} has no array {name!r}; make it with 'posse propagate'")
    frames = np.shape(arrays["t_s"])
    for name in _FIELDS:
        wanted = (*frames, len(_columns(name))) if len(_columns(name)) > 1 else frames
        array = arrays[name]
        if len(frames) != 1 or array.shape != wanted or array.dtype.kind not in "fiu":
            raise InputError(f"{path}: {name} has shape {array.shape}; {wanted} of numbers is needed")
        columns.update(zip(_columns(name), array.reshape(*frames, -1).T, strict=True))
    return str(arrays["epoch_utc"]), columns


def _read_csv(path: Path) -> tuple[str, dict[str, AnyArray]]:
    with open(path, newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    header, body = (rows[0], rows[1:]) if rows else ([], [])
    for column in ("epoch_utc", *(column for name in _FIELDS for column in _columns(name))):
        if column not in header:
            raise InputError(f"{path} has no column {column!r}; make it with 'posse propagate'")
    if not body:
        raise InputError(f"{path} has no frame")
    columns: dict[str, AnyArray] = {}
    for place, column in enumerate(header):
        try:
            values = [row[place] for row in body]
            if column != "epoch_utc":
                columns[column] = np.array(values, dtype=np.float64)
        except (IndexError, ValueError) as error:
            raise InputError(f"{path}: column {column!r}: {error}") from None
    return body[0][header.index("epoch_utc")], columns


def _unknown_suffix(path: Path) -> InputError:
    return InputError(f"{path}: a trajectory's name ends in .npz or .csv")
