"""Nets that guess, as a distribution that the command line finds."""

from __future__ import annotations

from pathlib import Path

import pytest

PACKAGES = Path(__file__).parents[1] / "packages"


@pytest.fixture(scope="session")
def guess_path(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A folder for PYTHONPATH that holds the distribution ``posse-guess``, as pip lays it."""
    site = tmp_path_factory.mktemp("guess")
    (site / "posse_guess.py").write_text((PACKAGES / "guess" / "posse_guess.py").read_text())
    info = site / "posse_guess-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: posse-guess\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[posse]\nguess = posse_guess\n")
    return str(site)
