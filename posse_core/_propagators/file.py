"""Propagator ``file``: a trajectory from another program or from a flight.

Frames are at the file's own instants, or at times of the scenario, for which the file is interpolated.
The scenario's relative motion is not used.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.interpolation import SAME_INSTANT_S, path_at
from posse_core._files.oem import Ephemeris, first_epoch, read_oem
from posse_core._files.tables import Table, check_orbit, read_table
from posse_core._frames import rtn_from_eci
from posse_core._interfaces.propagator import FirstState, PropagationProblem, Propagator
from posse_core._model.trajectory import PLANE_TURN, Motion
from posse_core._propagators.options import FileOptions
from posse_core._scenario.model import at_rate

_TARGET = ("t_s", "r_target_eci_m", "v_target_eci_m_s")
_RTN = ("r_chaser_rtn_m", "v_chaser_rtn_m_s")
_ECI = ("r_chaser_eci_m", "v_chaser_eci_m_s")
_CUBIC = 3


class FilePropagator(Propagator[FileOptions]):
    """Reads an NPZ or CSV file with the names of ``posse propagate``, or two CCSDS OEM files.

    NPZ and CSV files need ``t_s``, the target's state, and the chaser's state in RTN or ECI. t_s counts
    from the file's ``epoch_utc`` if it has one, and otherwise from the scenario's epoch. Extras in the
    file become extras of the motion. Of two OEM files, one is the target's and one the chaser's.

    Between the instants of a table, positions and velocities are those of the cubic polynomial through
    both, in ECI for the target and in RTN for the chaser; extras are linear. OEM are interpolated as
    their INTERPOLATION and INTERPOLATION_DEGREE say, by default through positions and velocities by
    polynomials of degree 7. If the chaser's OEM has other instants than the target's, frames are at the
    target's instants that both cover.
    """

    needs_starts = False

    def propagate(self, problem: PropagationProblem) -> Motion:
        if self._is_oem:
            return self._from_oem(problem)
        return _at_times(self._table_motion(problem.epoch), problem, str(self.options.path))

    def first_state(self) -> FirstState:
        path = self.options.path
        if self._is_oem:
            epoch = first_epoch(path)
            target = read_oem(path, epoch)
            return FirstState(epoch, target.r_eci_m[0], target.v_eci_m_s[0])
        table = self._table()
        since = table.epoch
        if since is None:
            raise InputError(
                f"{path}: has no epoch_utc, and the scenario no orbit with an epoch; add one of them"
            )
        first = int(table["t_s"].argmin())
        t_s = float(table["t_s"][first])
        r, v = (table[name][first] for name in _TARGET[1:])
        return FirstState(since if t_s == 0 else since.shifted(t_s), r, v)

    @property
    def _is_oem(self) -> bool:
        return self.options.path.suffix not in (".npz", ".csv")

    def _table(self) -> Table:
        table = read_table(self.options.path, (*_TARGET, *_RTN, *_ECI, "sequence"), extras=True)
        table.require(*_TARGET, *(_ECI if _in_eci(table) else _RTN))
        return table

    def _table_motion(self, epoch: Epoch) -> Motion:
        table = self._table()
        t_s, r_target, v_target = (table[name] for name in _TARGET)
        check_orbit(self.options.path, r_target, v_target)
        r, v = (table[name] for name in (_ECI if _in_eci(table) else _RTN))
        if _in_eci(table):
            r, v = rtn_from_eci(r_target, v_target, r, v, table.extras.get(PLANE_TURN, 0.0))
        sequence = table.arrays.get("sequence", np.zeros(len(t_s)))
        if table.epoch is not None:
            t_s = t_s + epoch.seconds_until(table.epoch)
        return Motion(t_s, r_target, v_target, r, v, sequence.astype(np.int64), table.extras)

    def _from_oem(self, problem: PropagationProblem) -> Motion:
        target_path, chaser_path = self.options.path, self.options.chaser_path
        if chaser_path is None:
            raise InputError(
                f"{target_path}: an OEM holds one object; give the chaser's as propagator.chaser_path"
            )
        target, chaser = (read_oem(path, problem.epoch) for path in (target_path, chaser_path))
        check_orbit(target_path, target.r_eci_m, target.v_eci_m_s)
        own_s = target.t_s[chaser.covers(target.t_s)]
        if not len(own_s):
            raise InputError(
                f"{chaser_path}: covers none of the instants of {target_path}, but"
                f" {chaser.t_s[0]:g} to {chaser.t_s[-1]:g} s after the epoch instead of"
                f" {target.t_s[0]:g} to {target.t_s[-1]:g} s; export both over the same interval"
            )
        t_s = own_s
        if problem.recorded_rate_hz is not None:
            t_s = at_rate(float(own_s[0]), float(own_s[-1]), problem.recorded_rate_hz)
        elif problem.requested:
            t_s = problem.t_s
        for each in (target, chaser):
            _refuse_beyond(each, t_s)
        (r_target, v_target), (r, v) = target.at(t_s), chaser.at(t_s)
        if t_s is own_s:
            chosen = np.isin(target.t_s, own_s)
            r_target, v_target = target.r_eci_m[chosen], target.v_eci_m_s[chosen]
        r, v = rtn_from_eci(r_target, v_target, r, v)
        return Motion(t_s, r_target, v_target, r, v, np.zeros(len(r), dtype=np.int64))


def _in_eci(table: Table) -> bool:
    """Whether the chaser's state is taken in ECI axes, which a file may have instead of RTN."""
    return _RTN[0] not in table.arrays and _ECI[0] in table.arrays


def _refuse_beyond(ephemeris: Ephemeris, t_s: FloatArray) -> None:
    beyond = ~ephemeris.covers(t_s)
    if beyond.any():
        raise InputError(_beyond(str(ephemeris.path), ephemeris.t_s, float(t_s[beyond.argmax()])))


def _beyond(path: str, own_s: FloatArray, t_s: float) -> str:
    return (
        f"times: a frame is to be at {t_s:.6g} s, which {path} does not cover: it has"
        f" {own_s.min():.6g} to {own_s.max():.6g} s after the epoch; choose times within, or 'times:"
        " null' for the file's own instants"
    )


def _at_times(motion: Motion, problem: PropagationProblem, path: str) -> Motion:
    """A motion at the times that the scenario asks for; each sequence has those within its own."""
    if not problem.requested:
        return motion
    pieces = []
    for number in np.unique(motion.sequence):
        own = np.flatnonzero(motion.sequence == number)
        own = own[np.argsort(motion.t_s[own], kind="stable")]
        times_s = motion.t_s[own]
        if np.any(np.diff(times_s) <= 0):
            raise InputError(f"{path}: two rows of a sequence are at one instant; leave one out")
        if problem.recorded_rate_hz is not None:
            t_s = at_rate(float(times_s[0]), float(times_s[-1]), problem.recorded_rate_hz)
        else:
            t_s = problem.t_s
            within = (t_s >= times_s[0] - SAME_INSTANT_S) & (t_s <= times_s[-1] + SAME_INSTANT_S)
            t_s = t_s[within]
        pieces.append(_interpolated(motion, own, t_s))
    t_s = np.concatenate([piece.t_s for piece in pieces])
    asked_s = t_s if problem.recorded_rate_hz is not None else problem.t_s
    missing = ~np.isin(asked_s, t_s)
    if missing.any():
        raise InputError(_beyond(path, motion.t_s, float(asked_s[missing.argmax()])))
    names = ("r_target_eci_m", "v_target_eci_m_s", "r_chaser_rtn_m", "v_chaser_rtn_m_s", "sequence")
    joined = {name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in names}
    extras = {name: np.concatenate([piece.extras[name] for piece in pieces]) for name in motion.extras}
    return Motion(t_s=t_s, extras=extras, **joined)


def _interpolated(motion: Motion, own: IntArray, t_s: FloatArray) -> Motion:
    """The rows ``own`` of a motion, in order of time, at other times."""
    times_s = motion.t_s[own]
    paths = [
        path_at(times_s, r[own], v[own], t_s, "HERMITE", _CUBIC)
        for r, v in (
            (motion.r_target_eci_m, motion.v_target_eci_m_s),
            (motion.r_chaser_rtn_m, motion.v_chaser_rtn_m_s),
        )
    ]
    extras = {}
    for name, rows in motion.extras.items():
        columns = rows[own].reshape(len(own), -1).T
        flat = np.stack([np.interp(t_s, times_s, column) for column in columns], axis=-1)
        extras[name] = flat.reshape(len(t_s), *rows.shape[1:])
    (r_target, v_target), (r, v) = paths
    sequence = np.repeat(motion.sequence[own[:1]], len(t_s))
    return replace(
        motion,
        t_s=t_s,
        r_target_eci_m=r_target,
        v_target_eci_m_s=v_target,
        r_chaser_rtn_m=r,
        v_chaser_rtn_m_s=v,
        sequence=sequence,
        extras=extras,
    )
