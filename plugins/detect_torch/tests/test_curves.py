"""What a training prints is explained: on the terminal, in its page, and in the documentation."""

import html
import json
import re
from pathlib import Path

import pytest
import safetensors

from posse_detect_torch.curves import MEANINGS

DOCUMENTED = (Path(__file__).parents[3] / "docs/detector.md").read_text()


@pytest.fixture(scope="module")
def small(make_dataset, tmp_path_factory) -> Path:
    return make_dataset(tmp_path_factory.mktemp("small") / "d", 20)


@pytest.mark.parametrize(
    ("detector", "settings"),
    [("nano", []), ("heatmap", []), ("sdn", ["-o", "regions=8"])],
)
def test_every_quantity_of_a_training_is_explained(detector, settings, small, posse, tmp_path):
    settings = [*settings, "-o", "input_px=64", "-o", "epochs=1", "-o", "batch=8"]
    code, _, said = posse("train", small, "--detector", detector, "--out", tmp_path / "o", *settings)
    assert code == 0, said
    assert "%|" not in said  # no bar where there is no terminal
    with safetensors.safe_open(str(tmp_path / "o/last.safetensors"), "pt") as file:
        (epoch,) = json.loads(file.metadata()["posse_training"])
    names = epoch.keys() - {"epoch"}
    assert len(names) > 2
    page = html.unescape((tmp_path / "o/curves.html").read_text())
    table = DOCUMENTED.partition("| detector | quantity | meaning |")[2].partition("\n\n")[0]
    for name in names:
        assert f"  {name}: {MEANINGS[name]}\n" in said
        assert MEANINGS[name] in page
        assert f"`{re.sub(' without NMS', '', name)}`" in table
