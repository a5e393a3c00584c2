"""Propagator ``file``: a trajectory that another program, or a flight, has made.

Frames are the file's own instants; the scenario's times and its relative motion are not used.
"""

from __future__ import annotations

import csv
import zipfile
from pathlib import Path

import numpy as np

from posse_core.dynamics.oem import read_oem
from posse_core.dynamics.orbit import orbit_epoch
from posse_core.environment.time import Epoch
from posse_core.errors import InputError
from posse_core.frames import rtn_from_eci
from posse_core.interfaces.propagator import PropagationProblem, Propagator
from posse_core.model.arrays import AnyArray, FloatArray
from posse_core.model.trajectory import Motion
from posse_core.propagators.options import FileOptions

_TARGET = ("t_s", "r_target_eci_m", "v_target_eci_m_s")
_RTN = ("r_chaser_rtn_m", "v_chaser_rtn_m_s")
_ECI = ("r_chaser_eci_m", "v_chaser_eci_m_s")
_SAME_INSTANT_S = 1e-6


class FilePropagator(Propagator):
    """NPZ and CSV with the names of ``posse propagate``; or two CCSDS OEM, target's and chaser's.

    NPZ and CSV need ``t_s``, the target's state, and the chaser's in RTN or ECI. t_s counts from
    ``epoch_utc`` where the file has it, else from the scenario's epoch.
    """

    options: FileOptions

    def propagate(self, problem: PropagationProblem) -> Motion:
        path = self.options.path
        epoch = orbit_epoch(problem.orbit)
        if path.suffix not in (".npz", ".csv"):
            return self._from_oem(epoch)
        columns = _read_npz(path) if path.suffix == ".npz" else _read_csv(path)
        t_s, r_target, v_target = (_column(columns, name, path) for name in _TARGET)
        names = _RTN if _RTN[0] in columns else _ECI
        r, v = (_column(columns, name, path) for name in names)
        if names is _ECI:
            r, v = rtn_from_eci(r_target, v_target, r, v)
        sequence = columns.get("sequence", np.zeros(len(t_s)))
        if len({len(x) for x in (t_s, r_target, v_target, r, v, sequence)}) != 1:
            raise InputError(f"{path}: its arrays have different lengths")
        if "epoch_utc" in columns:
            t_s = t_s + _seconds_between(epoch, Epoch.from_iso(str(columns["epoch_utc"])))
        return Motion(t_s, r_target, v_target, r, v, np.asarray(sequence).astype(np.int64))

    def _from_oem(self, epoch: Epoch) -> Motion:
        target_path, chaser_path = self.options.path, self.options.chaser_path
        if chaser_path is None:
            raise InputError(
                f"{target_path}: an OEM holds one object; name the chaser's as propagator.chaser_path"
            )
        target, chaser = read_oem(target_path, epoch), read_oem(chaser_path, epoch)
        if len(target.t_s) != len(chaser.t_s) or np.any(
            np.abs(target.t_s - chaser.t_s) > _SAME_INSTANT_S
        ):
            raise InputError(
                f"{chaser_path}: its epochs are not those of {target_path}; export both on one grid"
            )
        r, v = rtn_from_eci(target.r_eci_m, target.v_eci_m_s, chaser.r_eci_m, chaser.v_eci_m_s)
        return Motion(
            target.t_s, target.r_eci_m, target.v_eci_m_s, r, v, np.zeros(len(r), dtype=np.int64)
        )


def _read_npz(path: Path) -> dict[str, AnyArray]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: cannot be read as NPZ: {error}") from error


def _read_csv(path: Path) -> dict[str, AnyArray]:
    """Columns ``name`` → (F,), and ``name_x, name_y, name_z`` → name: (F, 3)."""
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            header, *rows = csv.reader(stream, skipinitialspace=True)
        named = (*_TARGET, *_RTN, *_ECI)
        wanted = {
            k: name for k, name in enumerate(header) if name in ("t_s", "sequence") or name[:-2] in named
        }
        table = {name: np.array([float(row[k]) for row in rows]) for k, name in wanted.items()}
        epochs = {row[header.index("epoch_utc")] for row in rows} if "epoch_utc" in header else set()
    except (OSError, UnicodeDecodeError, ValueError, IndexError) as error:
        raise InputError(f"{path}: cannot be read as CSV with a header: {error}") from error
    out: dict[str, AnyArray] = {name: table[name] for name in ("t_s", "sequence") if name in table}
    for name in (*_TARGET[1:], *_RTN, *_ECI):
        axes = [table.get(f"{name}_{axis}") for axis in "xyz"]
        if all(axis is not None for axis in axes):
            out[name] = np.stack([axis for axis in axes if axis is not None], axis=-1)
    if epochs:
        out["epoch_utc"] = np.array(min(epochs))
    return out


def _column(columns: dict[str, AnyArray], name: str, path: Path) -> FloatArray:
    if name not in columns:
        raise InputError(
            f"{path}: has no {name}; needed are {', '.join(_TARGET)}, and {', '.join(_RTN)} or"
            f" {', '.join(_ECI)}"
        )
    array = np.asarray(columns[name], dtype=np.float64)
    shape = (len(array),) if name == "t_s" else (len(array), 3)
    if array.shape != shape or len(array) == 0 or not np.all(np.isfinite(array)):
        raise InputError(f"{path}: {name} is not of finite numbers of shape {shape}")
    return array


def _seconds_between(start: Epoch, end: Epoch) -> float:
    zero = np.zeros(())
    (a1, a2), (b1, b2) = start.tt(zero), end.tt(zero)
    return float(((b1 - a1) + (b2 - a2)) * 86400.0)
