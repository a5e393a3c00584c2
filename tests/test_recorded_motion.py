"""Motion that another program has made: tables and CCSDS OEM, read by the propagator `file`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from skyfield.api import load
from skyfield.sgp4lib import TEME

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.tables import write_table
from posse_core._frames import eci_from_rtn
from posse_core._model.trajectory import Motion
from posse_core._plugins.loading import load_plugins
from posse_core._propagators.file import FilePropagator
from posse_core._propagators.options import FileOptions
from posse_core._scenario.load import load_scenario
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig, StateEciConfig
from posse_core._trajectory.build import make_trajectory
from posse_core._trajectory.problem import resolve

EPOCH = "2022-01-31T02:02:00"
T_S = np.array([0.0, 30.0, 60.0])
ANGLE = 1e-3 * T_S[:, None]
R_M = 7e6 * np.concatenate([np.cos(ANGLE), np.sin(ANGLE), 0 * ANGLE], axis=-1)
V_M_S = 7e3 * np.concatenate([-np.sin(ANGLE), np.cos(ANGLE), 0 * ANGLE], axis=-1)
R_RTN_M = np.array([[10.0, 20.0, -5.0], [11.0, 21.0, -4.0], [12.0, 22.0, -3.0]])
V_RTN_M_S = np.array([[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0.0, 0.2, 0.3]])
R_CHASER_M, V_CHASER_M_S = eci_from_rtn(R_M, V_M_S, R_RTN_M, V_RTN_M_S)
TARGET = {"t_s": T_S, "r_target_eci_m": R_M, "v_target_eci_m_s": V_M_S}
RTN = {"r_chaser_rtn_m": R_RTN_M, "v_chaser_rtn_m_s": V_RTN_M_S}
ECI = {"r_chaser_eci_m": R_CHASER_M, "v_chaser_eci_m_s": V_CHASER_M_S}


def read(path: Path, chaser: Path | None = None) -> Motion:
    state = StateEciConfig(epoch_utc=EPOCH, r_m=tuple(R_M[0]), v_m_s=tuple(V_M_S[0]))
    problem = resolve(
        orbit=OrbitConfig(state_eci=state),
        relative=RelativeConfig(roe_m=(0, 0, 1, 0, 1, 0)),
        t_s=np.zeros(1),
        constants=Constants(),
        needs_starts=FilePropagator.needs_starts,
    )
    return FilePropagator(FileOptions(path=path, chaser_path=chaser)).propagate(problem)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@pytest.mark.parametrize("chaser", [RTN, ECI], ids=["rtn", "eci"])
def test_tables(tmp_path: Path, suffix: str, chaser: dict[str, FloatArray]) -> None:
    path = tmp_path / f"t{suffix}"
    write_table(path, EPOCH, {**TARGET, **chaser})
    motion = read(path)
    np.testing.assert_array_equal(motion.t_s, T_S)
    np.testing.assert_array_equal(motion.r_target_eci_m, R_M)
    np.testing.assert_allclose(motion.r_chaser_rtn_m, R_RTN_M, atol=1e-8)
    np.testing.assert_allclose(motion.v_chaser_rtn_m_s, V_RTN_M_S, atol=1e-8)


def test_a_table_of_another_epoch(tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    write_table(path, "2022-01-31T03:02:00", {**TARGET, **RTN})
    np.testing.assert_allclose(read(path).t_s, T_S + 3600, atol=1e-6)


def test_a_table_without_the_chaser(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_table(path, EPOCH, TARGET)
    with pytest.raises(InputError, match="no r_chaser_rtn_m_x, r_chaser_rtn_m_y"):
        read(path)


def oem(
    r_m: FloatArray, v_m_s: FloatArray, frame: str = "GCRF", system: str = "UTC", start: str = EPOCH
) -> str:
    rows = [
        f"{Epoch.from_iso(start).shifted(float(t)).iso()} "
        + " ".join(f"{x / 1e3:.12f}" for x in (*r, *v))
        for t, r, v in zip(T_S, r_m, v_m_s, strict=True)
    ]
    return (
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2022-02-01T00:00:00\nORIGINATOR = TEST\n\nMETA_START\n"
        f"OBJECT_NAME = A\nCENTER_NAME = EARTH\nREF_FRAME = {frame}\nTIME_SYSTEM = {system}\nMETA_STOP\n"
        "COMMENT km and km/s\n"
        + "\n".join(rows)
        + "\nCOVARIANCE_START\nEPOCH = x\n1 2 3\nCOVARIANCE_STOP\n"
    )


def two(tmp_path: Path, target: str, chaser: str) -> tuple[Path, Path]:
    paths = tmp_path / "target.oem", tmp_path / "chaser.oem"
    for path, text in zip(paths, (target, chaser), strict=True):
        path.write_text(text)
    return paths


@pytest.mark.parametrize(("system", "start"), [("UTC", EPOCH), ("TAI", "2022-01-31T02:02:37")])
def test_two_oem(tmp_path: Path, system: str, start: str) -> None:
    texts = (
        oem(*state, system=system, start=start) for state in ((R_M, V_M_S), (R_CHASER_M, V_CHASER_M_S))
    )
    motion = read(*two(tmp_path, *texts))
    np.testing.assert_allclose(motion.t_s, T_S, atol=1e-6)
    np.testing.assert_allclose(motion.r_target_eci_m, R_M, atol=1e-6)
    np.testing.assert_allclose(motion.r_chaser_rtn_m, R_RTN_M, atol=1e-6)
    np.testing.assert_allclose(motion.v_chaser_rtn_m_s, V_RTN_M_S, atol=1e-6)


def test_an_oem_in_teme_is_rotated_as_skyfield_does(tmp_path: Path) -> None:
    text = oem(R_M, V_M_S, frame="TEME")
    motion = read(*two(tmp_path, text, text))
    tt = Epoch.from_iso(EPOCH).tt(np.zeros(()))
    R_teme_from_gcrf = TEME.rotation_at(load.timescale(builtin=True).tt_jd(*tt))
    # Skyfield's equinox leaves 0.1″ of GMST 1982's drift: 3.4 m here; unrotated it would be 38 km.
    np.testing.assert_allclose(motion.r_target_eci_m[0], R_teme_from_gcrf.T @ R_M[0], atol=4)


@pytest.mark.parametrize(
    ("target", "complaint"),
    [
        (oem(R_M, V_M_S, frame="ITRF2014"), "line 10: REF_FRAME is 'ITRF2014'; supported values: GCRF"),
        (oem(R_M, V_M_S).replace("EARTH", "MARS"), "CENTER_NAME is 'MARS'"),
        (oem(R_M, V_M_S)[:-60].replace("7000.0", "7000.0 x"), "finite numbers"),
        (oem(R_M[:, :2], V_M_S), "6 numbers"),
        (oem(R_M, V_M_S, start="2022-01-31T05:00:00"), "covers none of the instants"),
        ("CCSDS_OPM_VERS = 2.0\n", "CCSDS_OEM_VERS"),
    ],
)
def test_an_oem_that_cannot_be_used(tmp_path: Path, target: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as error:
        read(*two(tmp_path, target, oem(R_CHASER_M, V_CHASER_M_S)))
    assert ".oem" in str(error.value)
    assert "\n" not in str(error.value)


def test_one_oem_is_not_enough(tmp_path: Path) -> None:
    target, _ = two(tmp_path, oem(R_M, V_M_S), "")
    with pytest.raises(InputError, match=r"propagator\.chaser_path"):
        read(target)


def test_extras_of_a_table_come_along(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    extras = {"torque_n_m": np.arange(9.0).reshape(3, 3) / 7}
    write_table(path, EPOCH, {**TARGET, **RTN}, extras)
    np.testing.assert_array_equal(read(path).extras["torque_n_m"], extras["torque_n_m"])


@pytest.mark.parametrize("i_deg", [0, 180])
def test_a_recorded_motion_needs_no_orbit_that_could_be_flown(tmp_path: Path, i_deg: int) -> None:
    """Quasi-nonsingular relative elements mean nothing on the equator; the file has the motion."""
    path = tmp_path / "t.npz"
    write_table(path, EPOCH, {**TARGET, **RTN})
    elements = {"epoch_utc": EPOCH, "a_m": 4.2164e7, "e": 0, "i_deg": i_deg}
    angles = {"raan_deg": 0, "argp_deg": 0, "mean_anomaly_deg": 0}
    registry = load_plugins().registry
    asked = {"orbit": {"elements": {**elements, **angles}}, "relative": {"roe_m": [0, 0, 20, 0, 20, 0]}}
    scenario = load_scenario(
        "aqua", registry, {**asked, "propagator": {"name": "file", "path": path}, "times": None}
    )
    np.testing.assert_array_equal(make_trajectory(scenario, registry).r_chaser_rtn_m, R_RTN_M)
