"""The small scenario opened as a simulator, by a plain script in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from small_run import BOX_OBJ, SCENARIO


@pytest.fixture(scope="session")
def small_scenario(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    (folder / "box.obj").write_text(BOX_OBJ)
    path = folder / "small.yaml"
    path.write_text(SCENARIO.replace("seconds: 0.05", "seconds: 0"))
    return path


@pytest.fixture
def run_script(flat_renderer_path, small_scenario, tmp_path):
    """Run a script that has the flat renderer, in the scenario's folder; what its last line printed, as
    JSON."""

    def run(script: str, env: dict[str, str] | None = None, folder: Path | None = None):
        path = os.pathsep.join([str(flat_renderer_path), os.environ.get("PYTHONPATH", "")])
        file = tmp_path / "script.py"
        file.write_text(script)
        done = subprocess.run(
            [sys.executable, "-W", "error", file],
            cwd=folder or small_scenario.parent,
            env={**os.environ, "PYTHONPATH": path.strip(os.pathsep), **(env or {})},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1])

    return run
