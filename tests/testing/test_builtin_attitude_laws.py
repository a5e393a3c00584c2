"""The core's own attitude laws, held to what a third party's are held to."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core._files.tables import write_table
from posse_core._interfaces.attitude_law import AttitudeLaw
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.registry import Registry
from posse_core.testing import AttitudeLawConformance


def registry() -> Registry:
    return load_plugins().registry


class BuiltIn(AttitudeLawConformance):
    name: str
    options: ClassVar[dict[str, Any]] = {}

    def __init_subclass__(cls) -> None:
        cls.capabilities = registry().spec("attitude-law", cls.name).capabilities

    def law(self) -> AttitudeLaw:
        options = registry().options("attitude-law", self.name, self.options)
        made: AttitudeLaw = registry().create("attitude-law", self.name, options)
        return made


class TestNadir(BuiltIn):
    name = "nadir"


class TestSunPointing(BuiltIn):
    name = "sun-pointing"


class TestInertial(BuiltIn):
    name = "inertial"
    options: ClassVar = {"q_eci_from_body": (0.1, 0.2, -3.0, 0.4)}


class TestSpin(BuiltIn):
    name = "spin"
    options: ClassVar = {"body_axis": "-x", "sun_angle_deg": 40}


class TestNed(BuiltIn):
    name = "ned"


class TestNedOfTheSun(BuiltIn):
    name = "ned"
    options: ClassVar = {"down": "sun"}


class TestTracking(BuiltIn):
    name = "tracking"


class TestTumbling(BuiltIn):
    name = "tumbling"
    options: ClassVar = {"moments_kg_m2": (3, 4, 5), "rate_body_deg_s": (6, 5, 4)}


class TestTrack(BuiltIn):
    name = "track"


class TestTrackWithAnOffset(BuiltIn):
    name = "track"
    options: ClassVar = {"offset": 0.02}

    @pytest.mark.xfail(
        strict=True,
        reason="as in Blender, the error changes sides where the angle passes 180 degrees",
    )
    def test_attitude_and_rate_have_no_jumps(self) -> None:
        super().test_attitude_and_rate_have_no_jumps()


class TestPointingError(BuiltIn):
    name = "pointing-error"
    options: ClassVar = {"bias_deg": (1, 2, 3), "jitter_deg": (0.5, 0.5, 0.5)}


class TestRandom(BuiltIn):
    name = "random"


class TestRandomPointing(BuiltIn):
    name = "random-pointing"
    options: ClassVar = {"off_axis_deg": (1, 30)}


class TestFile(BuiltIn):
    name = "file"

    @pytest.fixture(autouse=True)
    def steady_spin(self, tmp_path: Path) -> None:
        """At a constant rate throughout, since the law's rate is that from each record to the next."""
        t_s = np.arange(-20.0, 6020.0, 20.0)
        q = Rotation.from_rotvec(np.outer(t_s, [0.01, -0.02, 0.005])).as_quat(scalar_first=True)
        arrays = {"t_s": t_s, "q_eci_from_body": q, "q_eci_from_camera": q}
        write_table(tmp_path / "recorded.npz", "2022-01-31T02:02:27.58", arrays)
        self.options = {"path": tmp_path / "recorded.npz"}  # type: ignore[misc]


def test_all_are_here() -> None:
    held = {case.name for case in BuiltIn.__subclasses__()}
    assert held == {s for s in registry().names("attitude-law") if registry().is_core("attitude-law", s)}
