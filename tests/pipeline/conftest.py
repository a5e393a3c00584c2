"""The small scenario's files, and the dataset that it makes."""

import os
from importlib.util import find_spec
from pathlib import Path

import pytest
from small_run import BOX_OBJ, SCENARIO


@pytest.fixture(scope="session")
def small_scenario(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    (folder / "box.obj").write_text(BOX_OBJ)
    path = folder / "small.yaml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="session")
def undisturbed(posse_in, small_scenario) -> Path:
    """The small scenario's dataset, made in one go. Tests must not change it."""
    done = posse_in(small_scenario.parent, "run", small_scenario, "--out", "undisturbed")
    assert done.returncode == 0, done.stderr
    return small_scenario.parent / "undisturbed"


@pytest.fixture(params=["local", "ray"])
def executor(request) -> str:
    """Each executor by name: what a test asks of one, all are held to."""
    if request.param == "ray" and find_spec("posse_executor_ray") is None:
        reason = "posse-executor-ray is not installed"
        if os.environ.get("POSSE_REQUIRE_RAY") == "1":
            pytest.fail(f"{reason} (POSSE_REQUIRE_RAY=1)")
        pytest.skip(reason)
    return request.param
