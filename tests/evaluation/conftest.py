from pathlib import Path

import cuboid
import pytest


@pytest.fixture(scope="session")
def dataset_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The cuboid's dataset, with its trajectory; not to be changed."""
    return cuboid.write_dataset(tmp_path_factory.mktemp("cuboid") / "d")
