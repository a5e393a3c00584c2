"""The navigator and the controller of docs/plugins.md, as two plugins of others, fly together."""

import re
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
from small_flight import SCENARIO

from posse_core._flight.fly import fly
from posse_core._plugins.loading import Plugins
from posse_core._scenario.load import load_scenario

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "plugins.md").read_text(encoding="utf-8")


def example(hook: str) -> str:
    (code,) = (
        code for code in re.findall(r"```python\n(.*?)```", TEXT, flags=re.S) if f"def {hook}(" in code
    )
    return code


def test_both_are_short_enough_to_read():
    for hook in ("posse_navigators", "posse_controllers"):
        assert len(example(hook).splitlines()) < 60


def test_they_reach_the_waypoint(tmp_path, monkeypatch):
    hooks = {"outside_navigator": "posse_navigators", "outside_controller": "posse_controllers"}
    for module, hook in hooks.items():
        (tmp_path / f"{module}.py").write_text(example(hook), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.syspath_prepend(ROOT / "tests" / "packages" / "flat")
    names = [*hooks, "posse_flat"]
    plugins = Plugins([EntryPoint(name, name, "posse") for name in names])
    assert {status.state for status in plugins.statuses} == {"ok"}
    (tmp_path / "small.yaml").write_text(SCENARIO)
    changes = {
        "flight.navigator": "hill",
        "flight.controller": "targeting",
        "flight.measurement.sigma_px": 0.1,
        "flight.errors.start.velocity_m_s": 0.001,
    }
    scenario = load_scenario(str(tmp_path / "small.yaml"), plugins.registry, changes)
    record = fly(scenario, None, plugins, resume=False, progress=lambda steps, _: steps)
    away_m = np.linalg.norm(record.r_true_rtn_m - record.r_waypoint_rtn_m[-1], axis=1)
    assert np.any(record.dv_rtn_m_s)
    assert away_m[0] > 4
    assert away_m[-1] < 0.5
