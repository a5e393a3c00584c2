from pathlib import Path

import cuboid
import pytest


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The cuboid's dataset, to be changed."""
    return cuboid.write_dataset(tmp_path / "d")
