"""Files are found in a scenario and in options by their type, wherever they stand."""

import os
from collections.abc import Mapping
from pathlib import Path

import pytest
from pydantic import Field

from posse_core import Options
from posse_core._errors import InputError
from posse_core._scenario.files import anchored, keys_of, with_files
from posse_core._scenario.track import read_track_config


class Layer(Options):
    picture: Path
    gain: float = 1.0


class Layered(Options):
    name: str = "x.png"
    base: Path | None = None
    layers: tuple[Layer, ...] = ()
    by_band: Mapping[str, Path] = Field(default_factory=dict)


OPTIONS = Layered(
    base=Path("a"),
    layers=(Layer(picture=Path("b")), Layer(picture=Path("c"))),
    by_band={"red": Path("d")},
)


def test_every_path_is_changed_and_nothing_else():
    seen = {}

    def change(key, path):
        seen[key] = path
        return Path("/there") / path

    moved = with_files(OPTIONS, change)
    keys = [("base",), ("layers", 0, "picture"), ("layers", 1, "picture"), ("by_band", "red")]
    assert seen == dict(zip(keys, map(Path, "abcd"), strict=True))
    assert moved == Layered(
        base=Path("/there/a"),
        layers=(Layer(picture=Path("/there/b")), Layer(picture=Path("/there/c"))),
        by_band={"red": Path("/there/d")},
    )
    assert with_files(Layered(), change) == Layered()


def test_keys_are_those_of_json_but_for_paths():
    keys = keys_of(OPTIONS)
    assert keys == {
        "name": "x.png",
        "base": Path("a"),
        "layers": [{"picture": Path("b"), "gain": 1.0}, {"picture": Path("c"), "gain": 1.0}],
        "by_band": {"red": Path("d")},
    }
    assert Layered.model_validate(keys) == OPTIONS


@pytest.mark.parametrize("confined", [True, False])
@pytest.mark.parametrize("name", ["../x", "in/../../x", "link", "link/x"])
def test_a_confined_path_stays_in_its_folder(tmp_path, name, confined):
    folder = tmp_path / "d"
    (folder / "in").mkdir(parents=True)
    os.symlink(tmp_path, folder / "link")
    if confined:
        with pytest.raises(InputError, match=r"here: .* leads out of"):
            anchored(Path(name), folder, "here", confined=True)
    else:
        assert anchored(Path(name), folder, "here", confined=False) == folder / name
    assert anchored(Path("in/x"), folder, "here", confined=confined) == folder / "in/x"
    assert anchored(Path("/x"), folder, "here", confined=confined) == Path("/x")


def test_nets_of_a_tracked_dataset_are_in_its_folder(tmp_path):
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("flight: {measurement: {boxes: inputs/b.onnx, keypoints: inputs/k.onnx}}\n")
    read = read_track_config(scenario, {"measurement.keypoints": "own.onnx"}).measurement
    assert (read.boxes, read.keypoints) == (tmp_path / "inputs/b.onnx", Path("own.onnx").absolute())
    scenario.write_text("flight: {measurement: {boxes: ../b.onnx}}\n")
    with pytest.raises(InputError, match=r"flight\.measurement\.boxes: '\.\./b\.onnx' leads out of"):
        read_track_config(scenario, {})
