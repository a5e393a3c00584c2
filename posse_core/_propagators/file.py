"""Propagator ``file``: a trajectory from another program or from a flight.

Frames are at the file's own instants; the scenario's times and relative motion are not used.
"""

from __future__ import annotations

import numpy as np

from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.oem import read_oem
from posse_core._files.tables import check_orbit, read_table
from posse_core._frames import rtn_from_eci
from posse_core._interfaces.propagator import PropagationProblem, Propagator
from posse_core._model.trajectory import Motion
from posse_core._propagators.options import FileOptions

_TARGET = ("t_s", "r_target_eci_m", "v_target_eci_m_s")
_RTN = ("r_chaser_rtn_m", "v_chaser_rtn_m_s")
_ECI = ("r_chaser_eci_m", "v_chaser_eci_m_s")
_SAME_INSTANT_S = 1e-6


class FilePropagator(Propagator[FileOptions]):
    """Reads an NPZ or CSV file with the names of ``posse propagate``, or two CCSDS OEM files.

    NPZ and CSV files need ``t_s``, the target's state, and the chaser's state in RTN or ECI. t_s counts
    from the file's ``epoch_utc`` if it has one, and otherwise from the scenario's epoch. Extras in the
    file become extras of the motion. Of two OEM files, one is the target's and one the chaser's.
    """

    needs_starts = False

    def propagate(self, problem: PropagationProblem) -> Motion:
        path = self.options.path
        if path.suffix not in (".npz", ".csv"):
            return self._from_oem(problem.epoch)
        table = read_table(path, (*_TARGET, *_RTN, *_ECI, "sequence"), extras=True)
        t_s, r_target, v_target = (table[name] for name in _TARGET)
        check_orbit(path, r_target, v_target)
        names = _ECI if _RTN[0] not in table.arrays and _ECI[0] in table.arrays else _RTN
        r, v = (table[name] for name in names)
        if names is _ECI:
            r, v = rtn_from_eci(r_target, v_target, r, v)
        sequence = table.arrays.get("sequence", np.zeros(len(t_s)))
        if table.epoch_utc is not None:
            t_s = t_s + problem.epoch.seconds_until(Epoch.from_iso(table.epoch_utc))
        return Motion(t_s, r_target, v_target, r, v, sequence.astype(np.int64), table.extras)

    def _from_oem(self, epoch: Epoch) -> Motion:
        target_path, chaser_path = self.options.path, self.options.chaser_path
        if chaser_path is None:
            raise InputError(
                f"{target_path}: an OEM holds one object; give the chaser's as propagator.chaser_path"
            )
        target, chaser = read_oem(target_path, epoch), read_oem(chaser_path, epoch)
        if len(target.t_s) != len(chaser.t_s) or np.any(
            np.abs(target.t_s - chaser.t_s) > _SAME_INSTANT_S
        ):
            raise InputError(
                f"{chaser_path}: its epochs are not those of {target_path}; export both on one grid"
            )
        check_orbit(target_path, target.r_eci_m, target.v_eci_m_s)
        r, v = rtn_from_eci(target.r_eci_m, target.v_eci_m_s, chaser.r_eci_m, chaser.v_eci_m_s)
        return Motion(
            target.t_s, target.r_eci_m, target.v_eci_m_s, r, v, np.zeros(len(r), dtype=np.int64)
        )
