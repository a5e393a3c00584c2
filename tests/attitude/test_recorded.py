"""Attitudes from files: CCSDS AEM of both issues, and what `posse propagate` writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._arrays import FloatArray
from posse_core._attitude.recorded import Recording
from posse_core._environment.time import Epoch
from posse_core._errors import InputError
from posse_core._files.tables import write_table

EPOCH = Epoch.from_iso("2022-01-31T02:02:00")
HEAD = "CCSDS_AEM_VERS = 2.0\nCREATION_DATE = 2022-02-01T00:00:00\nORIGINATOR = TEST\n"
META = {
    "OBJECT_NAME": "AQUA",
    "REF_FRAME_A": "ICRF",
    "REF_FRAME_B": "SC_BODY_1",
    "TIME_SYSTEM": "UTC",
    "ATTITUDE_TYPE": "QUATERNION",
}
Q1, Q2, Q3, QC = 0.1, -0.5, 0.7, 0.5


def message(rows: list[str], **changed: str) -> str:
    meta = "".join(f"{key} = {value}\n" for key, value in {**META, **changed}.items())
    return (
        f"{HEAD}COMMENT a test\nMETA_START\n{meta}META_STOP\nDATA_START\n"
        + "\n".join(rows)
        + "\nDATA_STOP\n"
    )


def standards_matrix(q1: float, q2: float, q3: float, qc: float) -> FloatArray:
    """x_B = M x_A of a quaternion from A to B, as the standard's annex writes it out."""
    return np.array(
        [
            [q1**2 - q2**2 - q3**2 + qc**2, 2 * (q1 * q2 + q3 * qc), 2 * (q1 * q3 - q2 * qc)],
            [2 * (q1 * q2 - q3 * qc), -(q1**2) + q2**2 - q3**2 + qc**2, 2 * (q2 * q3 + q1 * qc)],
            [2 * (q1 * q3 + q2 * qc), 2 * (q2 * q3 - q1 * qc), -(q1**2) - q2**2 + q3**2 + qc**2],
        ]
    )


@pytest.mark.parametrize(
    ("changed", "numbers", "body_first"),
    [
        ({}, (Q1, Q2, Q3, QC), False),
        ({"ATTITUDE_DIR": "A2B", "QUATERNION_TYPE": "LAST"}, (Q1, Q2, Q3, QC), False),
        ({"ATTITUDE_DIR": "A2B", "QUATERNION_TYPE": "FIRST"}, (QC, Q1, Q2, Q3), False),
        ({"ATTITUDE_DIR": "B2A"}, (Q1, Q2, Q3, QC), True),
        ({"REF_FRAME_A": "SC_BODY_1", "REF_FRAME_B": "GCRF"}, (Q1, Q2, Q3, QC), True),
        ({"ATTITUDE_TYPE": "QUATERNION/DERIVATIVE"}, (Q1, Q2, Q3, QC, 0.0, 0.0, 0.0, 0.0), False),
    ],
)
def test_every_way_to_write_a_quaternion(
    tmp_path: Path, changed: dict[str, str], numbers: tuple[float, ...], body_first: bool
) -> None:
    path = tmp_path / "a.aem"
    path.write_text(message(["2022-01-31T02:02:00 " + " ".join(map(str, numbers))], **changed))
    R = Recording.read(path, "q_eci_from_body", EPOCH).at(np.zeros(1))[0]
    M = standards_matrix(Q1, Q2, Q3, QC)
    np.testing.assert_allclose(R, M if body_first else M.T, atol=1e-14)


def test_eme2000_is_23_mas_off(tmp_path: Path) -> None:
    path = tmp_path / "a.aem"
    path.write_text(message(["2022-01-31T02:02:00 0 0 0 1"], REF_FRAME_A="EME2000"))
    R = Recording.read(path, "q_eci_from_body", EPOCH).at(np.zeros(1))[0]
    # Frame bias (IERS Conventions 2010, 5.20): ξ0 −16.617, η0 −6.819, dα0 −14.6 mas.
    turn_mas = np.degrees(Rotation.from_matrix(R).magnitude()) * 3.6e6
    assert turn_mas == pytest.approx(np.linalg.norm([16.617, 6.819, 14.6]), abs=0.1)


@pytest.mark.parametrize(
    ("system", "first"),
    [
        ("UTC", "2022-01-31T02:02:00"),
        ("UTC", "2022-031T02:02:00Z"),
        ("TAI", "2022-01-31T02:02:37"),
        ("TT", "2022-01-31T02:03:09.184"),
        ("GPS", "2022-01-31T02:02:18"),
    ],
)
def test_time_systems(tmp_path: Path, system: str, first: str) -> None:
    path = tmp_path / "a.aem"
    second = first.replace("02:02:", "02:04:").replace("02:03:", "02:05:")
    path.write_text(message([f"{first} 0 0 0 1", f"{second} 0 0 1 0"], TIME_SYSTEM=system))
    quarter = Recording.read(path, "q_eci_from_body", EPOCH).at(np.array([60.0]))[0]
    np.testing.assert_allclose(np.abs(quarter @ np.array([1.0, 0, 0])), [0, 1, 0], atol=1e-6)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@pytest.mark.parametrize("offset_s", [0.0, 3600.0])
def test_a_steady_spin_is_met_between_its_records(tmp_path: Path, suffix: str, offset_s: float) -> None:
    axis = np.array([0.6, 0.0, 0.8])
    start = Rotation.from_quat([0.1, 0.2, 0.3, 0.4])

    def spin(t_s: FloatArray) -> Rotation:
        return start * Rotation.from_rotvec(0.3 * t_s[:, None] * axis)

    times = np.array([-2.0, 0.0, 1.0, 5.0, 9.0])
    path = tmp_path / f"a{suffix}"
    arrays = {"t_s": times + offset_s, "q_eci_from_camera": np.roll(spin(times).as_quat(), 1, axis=-1)}
    write_table(path, EPOCH.shifted(-offset_s).iso(), arrays)
    wanted = np.linspace(-2, 9, 40)
    R = Recording.read(path, "q_eci_from_camera", EPOCH).at(wanted)
    np.testing.assert_allclose(R, spin(wanted).as_matrix(), atol=1e-9)


@given(
    q=st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: sum(x * x for x in q) > 0.01)
)
def test_the_record_itself_is_returned(tmp_path_factory: pytest.TempPathFactory, q: list[float]) -> None:
    path = tmp_path_factory.mktemp("aem") / "a.aem"
    q = [x / float(np.linalg.norm(q)) for x in q]
    path.write_text(message([f"2022-01-31T02:02:00 {q[0]} {q[1]} {q[2]} {q[3]}"]))
    R = Recording.read(path, "q_eci_from_body", EPOCH).at(np.zeros(1))[0]
    np.testing.assert_allclose(R.T, standards_matrix(*q), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("CCSDS_OEM_VERS = 2.0\n", "CCSDS_AEM_VERS"),
        (message([]), "no attitudes"),
        (message(["2022-01-31T02:02:00 0 0 1"]), "line 13: an attitude is"),
        (message(["2022-01-31T02:02:00 0 0 0 one"]), "line 13: .*finite numbers"),
        (message(["yesterday 0 0 0 1"]), "line 13: the epoch 'yesterday'"),
        (message(["2022-01-31T02:02:00 0 0 0 2"]), "line 13: a quaternion is not of length one"),
        (message(["2022-01-31T02:02:00 0 0 0 1"], REF_FRAME_A="LVLH"), "LVLH and SC_BODY_1"),
        (message(["2022-01-31T02:02:00 0 0 0 1"], ATTITUDE_TYPE="SPIN"), "ATTITUDE_TYPE is 'SPIN'"),
        (message(["2022-01-31T02:02:00 0 0 0 1"], TIME_SYSTEM="MJD"), "TIME_SYSTEM is 'MJD'"),
        (message(["2022-01-31T02:02:01 0 0 0 1"]), "a frame is at 0 s"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "a.aem"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint) as error:
        Recording.read(path, "q_eci_from_body", EPOCH).at(np.zeros(1))
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_and_a_table_without_attitude(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        Recording.read(tmp_path / "none.aem", "q_eci_from_body", EPOCH).at(np.zeros(1))
    path = tmp_path / "a.csv"
    path.write_text("t_s\n0\n")
    with pytest.raises(InputError, match="no q_eci_from_body_w"):
        Recording.read(path, "q_eci_from_body", EPOCH).at(np.zeros(1))


def test_times_must_increase(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_table(
        path, EPOCH.iso(), {"t_s": np.zeros(2), "q_eci_from_body": np.tile([1.0, 0, 0, 0], (2, 1))}
    )
    with pytest.raises(InputError, match="do not increase"):
        Recording.read(path, "q_eci_from_body", EPOCH).at(np.zeros(1))
