"""Runs that come to grief again and again, by seed: what they leave is equal to the bit all the same.

POSSE_FAULT_ROUNDS says how many datasets are made so; what befalls them stands in
``tests/support/faults.py``.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROUNDS = int(os.environ.get("POSSE_FAULT_ROUNDS", "2"))
SUPPORT = Path(__file__).parents[1] / "support"


@pytest.fixture
def endure(flat_renderer_path, small_scenario):
    def endure(folder: Path, rounds: int, *url: str) -> None:
        path = [SUPPORT, flat_renderer_path, os.environ.get("PYTHONPATH", "")]
        arguments = [small_scenario, folder, str(rounds), "0", *url]
        done = subprocess.run(
            [sys.executable, "-c", "from faults import main; main()", *arguments],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path)).strip(os.pathsep)},
            capture_output=True,
            text=True,
            timeout=300 * (1 + rounds),
        )
        assert done.returncode == 0, done.stderr
        assert sum(json.loads(done.stdout).values()) >= rounds

    return endure


def test_any_row_of_faults_leaves_the_dataset_of_an_undisturbed_run(endure, tmp_path):
    endure(tmp_path, ROUNDS)


def test_so_does_any_row_of_faults_of_a_network_store(endure, server, refusing):
    server.mkdir("faults")
    endure(refusing.parent, ROUNDS, "s3://faults/sets")
