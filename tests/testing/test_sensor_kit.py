"""The kit of sensors catches what it is there for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from posse_core import ComponentError, NoOptions, Reading, Sensor, SensorLook
from posse_core._interfaces.sensor import StoredReading
from posse_core.testing import SensorConformance

WRITTEN = "test_its_readings_can_be_written"
SAME = "test_every_reading_has_the_same_arrays_and_files"
ALONE = "test_a_reading_does_not_depend_on_others"
TWICE = "test_two_readings_of_a_frame_are_told_apart"
FAULTS = "test_its_readings_have_no_faults"
UNTOUCHED = "test_what_it_is_given_is_left_alone"

CAUGHT = {
    "nothing": {},
    "infinity where nothing is hit": {WRITTEN: "give None for no value"},
    "label that JSON does not have": {WRITTEN: "which JSON does not have"},
    "image of floats": {WRITTEN: "of uint8 or uint16"},
    "label left out": {SAME: "readings are of several kinds"},
    "array left out": {SAME: "readings are of several kinds"},
    "array of another type": {SAME: "readings are of several kinds"},
    "file left out": {SAME: "readings are of several kinds"},
    "drift by the number of readings": {ALONE: "read again in another order"},
    "noise of its own": {ALONE: "read again in another order"},
    "number of the sensor": {ALONE: "from another sensor"},
    "first reading alone": {TWICE: "no second reading"},
    "other axes in faults": {FAULTS: "is at"},
    "modifies the state": {UNTOUCHED: "the state was modified"},
}
MADE = [0]


class Laser(Sensor[NoOptions]):
    """The distance along the axis and along four rays beside it, with one thing wrong."""

    read = 0

    def __init__(self, wrong: str) -> None:
        super().__init__(NoOptions())
        self.wrong = wrong
        MADE[0] += 1
        self.number = MADE[0]

    def sense(self, look: SensorLook) -> Reading:
        wrong = self.wrong
        self.read += 1
        if wrong == "first reading alone" and look.number > 0:
            raise ComponentError("there is no second reading")
        rays = np.array([[0.0, 0.0, 1.0], [0.02, 0, 1], [-0.02, 0, 1], [0, 0.02, 1], [0, -0.02, 1]])
        distance_m = look.rays(rays).distance_m
        seen = bool(np.isfinite(distance_m[0]))
        true_m = float(distance_m[0]) if seen else None
        noise_m = look.generator("range").normal(0.0, 0.01, 5)
        if wrong == "noise of its own":
            noise_m = np.random.default_rng().normal(0.0, 0.01, 5)
        range_m = np.where(np.isfinite(distance_m), distance_m + noise_m, np.nan)
        labels: dict[str, Any] = {"true_range_m": true_m, "hits": int(np.isfinite(distance_m).sum())}
        arrays = {"range_m": range_m.astype(np.float32)}
        files = {".txt": str(true_m).encode()}
        image = None
        if wrong == "infinity where nothing is hit":
            labels["true_range_m"] = float(distance_m[0])
        if wrong == "label that JSON does not have":
            labels["box"] = look.view().box
        if wrong == "image of floats":
            image = np.zeros((4, 4))
        if wrong == "label left out" and not seen:
            del labels["true_range_m"]
        if wrong == "array left out" and not seen:
            arrays = {}
        if wrong == "array of another type" and not seen:
            arrays = {"range_m": range_m}
        if wrong == "file left out" and not seen:
            files = {}
        if wrong == "drift by the number of readings":
            labels["bias_m"] = 0.01 * self.read
        if wrong == "number of the sensor":
            labels["serial"] = self.number
        if wrong == "modifies the state":
            look._standpoint.state.craft.t_body_cam_m[:] += 1.0
        return Reading(labels, arrays, image, files)

    def faults(self, stored: StoredReading) -> Iterator[str]:
        true_m = stored.reading.labels.get("true_range_m")
        if true_m is None:
            return
        axis = [0.1, 0.0, 1.0] if self.wrong == "other axes in faults" else [0.0, 0.0, 1.0]
        axis_m = float(stored.distances_m([axis], [0, 0, 0], 0)[0])
        if abs(axis_m - true_m) > 1e-6:
            yield f"true_range_m is {true_m:.6f}, and the mesh is at {axis_m:.6f} m"


@pytest.mark.parametrize("wrong", CAUGHT)
def test_a_wrong_sensor_fails_for_its_own_reason(wrong: str) -> None:
    class Case(SensorConformance):
        def sensor(self) -> Sensor[Any]:
            return Laser(wrong)

    for test in (name for name in vars(SensorConformance) if name.startswith("test_")):
        reason = CAUGHT[wrong].get(test)
        if reason is not None:
            with pytest.raises((AssertionError, ComponentError), match=reason):
                getattr(Case(), test)()
        elif not CAUGHT[wrong]:
            getattr(Case(), test)()
