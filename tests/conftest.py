"""Shared by all tests: hypothesis profiles, and the command line run as a user runs it."""

import contextlib
import os
import subprocess
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import pytest
from forked import Origin
from hypothesis import HealthCheck, settings

_SLOW_MACHINE = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("default", max_examples=25, derandomize=True, **_SLOW_MACHINE)
settings.register_profile("thorough", max_examples=1000, **_SLOW_MACHINE)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))

os.environ["POSSE_SHOW_FAULTS"] = "1"  # what nothing foresaw shows its traceback in every test

PACKAGES = Path(__file__).parent / "packages"


def _laid(site: Path, name: str, module: str) -> Path:
    """Lay a distribution of tests/packages into a folder for PYTHONPATH, as pip does."""
    (package,) = PACKAGES.glob(f"*/{module}.py")
    (site / package.name).write_text(package.read_text())
    info = site / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    point = name.removeprefix("posse-").replace("-", "_")
    (info / "entry_points.txt").write_text(f"[posse]\n{point} = {module}\n")
    return site


@pytest.fixture(scope="session")
def flat_renderer_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for PYTHONPATH that holds the distribution ``posse-render-flat``."""
    return _laid(tmp_path_factory.mktemp("site"), "posse-render-flat", "posse_flat")


@pytest.fixture(scope="session")
def faulty_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for PYTHONPATH that holds the distribution ``posse-faulty``."""
    return _laid(tmp_path_factory.mktemp("site"), "posse-faulty", "posse_faulty")


@pytest.fixture(scope="session")
def guess_path(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A folder for PYTHONPATH that holds the distribution ``posse-guess``, nets that guess."""
    return str(_laid(tmp_path_factory.mktemp("site"), "posse-guess", "posse_guess"))


@pytest.fixture(scope="session")
def environment_with(flat_renderer_path: Path):
    """The environment of a command, with the flat renderer and some variables of its own."""

    def make(more: Mapping[str, str] | None) -> dict[str, str]:
        own = more or {}
        paths = [str(flat_renderer_path), own.get("PYTHONPATH", ""), os.environ.get("PYTHONPATH", "")]
        return {**os.environ, **own, "PYTHONPATH": os.pathsep.join(filter(None, paths))}

    return make


@pytest.fixture(scope="session")
def start_posse_in(environment_with):
    """Start the command line in a process of its own: start_posse_in(folder, "run", ...)."""

    def start(
        folder: Path, *arguments: object, env: dict[str, str] | None = None
    ) -> subprocess.Popen[str]:
        code = "from posse_core._cli.main import main; main()"
        return subprocess.Popen(
            [sys.executable, "-c", code, *map(str, arguments)],
            cwd=folder,
            env=environment_with(env),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return start


@pytest.fixture(scope="session")
def posse_in(environment_with):
    """Run the command line to its end in a process of its own: posse_in(folder, "run", ...).

    The processes are forked from one that has imported what they need: with hundreds of commands, to
    import it each time would take minutes.
    """
    with contextlib.closing(Origin()) as origin:

        def call(
            folder: Path, *arguments: object, env: dict[str, str] | None = None
        ) -> subprocess.CompletedProcess[str]:
            words = list(map(str, arguments))
            ended = origin.run(folder, words, environment_with(env))
            return subprocess.CompletedProcess(words, ended.code, ended.out, ended.error)

        yield call


@pytest.fixture
def start_posse(start_posse_in, tmp_path: Path):
    """:func:`start_posse_in` in ``tmp_path``."""
    return partial(start_posse_in, tmp_path)


@pytest.fixture
def posse(posse_in, tmp_path: Path):
    """:func:`posse_in` in ``tmp_path``."""
    return partial(posse_in, tmp_path)
