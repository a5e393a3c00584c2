"""The kit of attitude laws catches what it is there for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import AttitudeLaw, ComponentError, NoOptions, Surroundings
from posse_core._arrays import FloatArray
from posse_core.testing import AttitudeLawConformance

ROTATIONS = "test_it_gives_a_rotation_for_each_frame"
ROWS = "test_a_frame_does_not_depend_on_the_others"
BITS = "test_the_same_frames_give_the_same_bits"
UNTOUCHED = "test_the_surroundings_are_left_alone"
JUMPS = "test_attitude_and_rate_have_no_jumps"
TESTS = {ROTATIONS, ROWS, BITS, UNTOUCHED, JUMPS}


def about_x(angle_rad: FloatArray) -> FloatArray:
    return Rotation.from_rotvec(np.outer(angle_rad, [1.0, 0.0, 0.0])).as_matrix()


def sweeping(around: Surroundings) -> FloatArray:
    """To and fro by 30° in 40 s, smoothly."""
    return about_x(np.radians(30) * np.sin(2 * np.pi * around.t_s / 40))


def spoiled(wrong: str) -> type[AttitudeLaw[NoOptions]]:
    class Spoiled(AttitudeLaw[NoOptions]):
        buffer: FloatArray | None = None
        asked = 0

        def attitude(self, around: Surroundings) -> FloatArray:
            return FAULTS[wrong](self, around)

    return Spoiled


def modifies(around: Surroundings) -> FloatArray:
    R = sweeping(around)
    around.r_chaser_rtn_m[:] *= -1
    return R


def remembers(law: AttitudeLaw, around: Surroundings) -> FloatArray:
    law.asked += 1  # type: ignore[attr-defined]
    return about_x(around.t_s / 100 + law.asked)  # type: ignore[attr-defined]


def reuses_memory(law: AttitudeLaw, around: Surroundings) -> FloatArray:
    buffer: FloatArray | None = law.buffer  # type: ignore[attr-defined]
    if buffer is None or buffer.shape[0] != len(around.t_s):
        buffer = law.buffer = np.empty((len(around.t_s), 3, 3))  # type: ignore[attr-defined]
    buffer[:] = sweeping(around)
    return buffer


def triangular(around: Surroundings) -> FloatArray:
    """A scan at a constant rate from one end to the other and back, within 40 s."""
    return about_x(np.radians(30) * np.abs(around.t_s / 20 % 2 - 1))


FAULTS: dict[str, Callable[[AttitudeLaw, Surroundings], object]] = {
    "none": lambda law, around: sweeping(around),
    "stretched": lambda law, around: 1.00001 * sweeping(around),
    "mirrored": lambda law, around: -sweeping(around),
    "transposed axes": lambda law, around: np.moveaxis(sweeping(around), 0, -1),
    "quaternions": lambda law, around: np.tile([1.0, 0.0, 0.0, 0.0], (len(around.t_s), 1)),
    "not a number": lambda law, around: sweeping(around) + np.nan,
    "single precision": lambda law, around: sweeping(around).astype(np.float32),
    "mean time": lambda law, around: about_x((around.t_s - around.t_s.mean()) / 100),
    "number of the row": lambda law, around: about_x(np.arange(len(around.t_s)) / 10),
    "sum so far": lambda law, around: about_x(np.cumsum(around.r_chaser_rtn_m[:, 0]) / 1000),
    "unseeded": lambda law, around: about_x(np.random.default_rng().normal(size=len(around.t_s))),
    "counts": remembers,
    "reuses memory": reuses_memory,
    "modifies": lambda law, around: modifies(around),
    "steps": lambda law, around: about_x(0.01 * np.floor(around.t_s / 7)),
    "one step": lambda law, around: about_x(0.001 * (around.t_s > 1234.5)),
    "triangular": lambda law, around: triangular(around),
    "drawn by time": lambda law, around: about_x(
        np.array([np.random.default_rng(abs(int(t * 1e6))).normal(scale=0.01) for t in around.t_s])
    ),
}
CAUGHT: dict[str, set[str]] = {
    "none": set(),
    "stretched": {ROTATIONS},
    "mirrored": {ROTATIONS},
    "transposed axes": {ROTATIONS},
    "quaternions": {ROTATIONS},
    "not a number": {ROTATIONS},
    "single precision": {ROTATIONS},
    "mean time": {ROWS},
    "number of the row": {ROWS},
    "sum so far": {ROWS},
    "unseeded": {ROWS, BITS, JUMPS},
    "counts": {BITS},
    "reuses memory": {BITS},
    "modifies": {UNTOUCHED},
    "steps": {JUMPS},
    "one step": {JUMPS},
    "triangular": {JUMPS},
    "drawn by time": {JUMPS},
}


@pytest.mark.parametrize("subject", ["target", "camera"])
@pytest.mark.parametrize("wrong", FAULTS)
def test_a_wrong_law_fails(wrong: str, subject: str) -> None:
    class Case(AttitudeLawConformance):
        capabilities = frozenset({subject})

        def law(self) -> AttitudeLaw:
            return spoiled(wrong)(NoOptions())

    failed = set()
    for test in TESTS:
        try:
            getattr(Case(), test)()
        except (AssertionError, ComponentError, IndexError, ValueError):
            failed.add(test)
    assert failed >= CAUGHT[wrong]
    if not CAUGHT[wrong]:
        assert not failed


def test_a_law_without_a_capability_fails() -> None:
    with pytest.raises(AssertionError, match="target, camera or both"):
        AttitudeLawConformance().test_it_can_orient_target_or_camera()
