"""The small scenario's files, and the dataset that it makes."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import fsspec
import pytest
from small_run import BOX_OBJ, SCENARIO

SUPPORT = Path(__file__).parents[1] / "support"


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


@pytest.fixture(scope="session")
def refusing(tmp_path_factory) -> Path:
    """While this file exists, the server refuses every write."""
    return tmp_path_factory.mktemp("server") / "refusing"


@pytest.fixture(scope="session")
def server(refusing):
    """The file system of an S3-compatible server on loopback, which the environment names, too."""
    with (
        pytest.MonkeyPatch.context() as patch,
        subprocess.Popen(
            [sys.executable, SUPPORT / "s3_server.py", refusing], stdout=subprocess.PIPE, text=True
        ) as process,
    ):
        port = process.stdout.readline().strip()
        patch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}")
        patch.setenv("AWS_ACCESS_KEY_ID", "someone")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        yield fsspec.filesystem("s3", use_listings_cache=False)
        process.kill()
