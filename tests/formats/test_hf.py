"""The folder for Hugging Face as ``datasets``, ``huggingface_hub`` and ``mlcroissant`` read it, against
the dataset's label lines."""

from __future__ import annotations

import json
import os
import subprocess
from datetime import datetime
from pathlib import Path
from typing import Any

os.environ["HF_HUB_OFFLINE"] = "1"  # before the libraries are imported: nothing is asked of a hub

import company
import cuboid
import mlcroissant
import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from datasets import DatasetDict, load_dataset
from huggingface_hub import DatasetCard
from PIL import Image

from posse_core import __version__
from posse_core._cli.export import command
from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._formats.hf import HfOptions, HfWriter
from posse_core._selection.partition import write_partition

# rdflib's own, which mlcroissant uses
pytestmark = pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")

TWO = (("brick", cuboid.HALF), ("plate", np.array([2.0, 1.0, 0.1])))
SAME = ("index", "sequence", "t_s", "epoch_utc", "sun_fraction_target", "spacecraft", "box_visible_px")
SAME += ("box_whole_px", "mask_rle", "mask_area_px", "fraction_visible", "fraction_lit")
SAME += ("q_cam_from_body", "t_body_cam_m", "range_m", "phase_angle_rad", "sun_direction_body")


def export(folder: Path, *options: str) -> Path:
    done = CliRunner().invoke(command, [str(folder), "--format", "hf", *options])
    assert done.exit_code == 0, (done.output, done.exception)
    return folder / "hf"


def loaded(folder: Path, cache: Path) -> DatasetDict:
    return load_dataset(str(folder), cache_dir=str(cache))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two spacecraft, divided into three parts, and exported twice: before and after."""
    folder = cuboid.write_dataset(tmp_path_factory.mktemp("two") / "d", TWO)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["versions"] = {"posse-core": __version__}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    export(folder)
    write_partition(Dataset(folder), (0.5, 0.25, 0.25), 3, "frame")
    export(folder, "-o", "hf.licence=cc-by-4.0", "-o", "hf.published=2027-03-31")
    return folder


@pytest.fixture(scope="module")
def read(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> DatasetDict:
    return loaded(folder / "hf", tmp_path_factory.mktemp("cache"))


def same_labels(record: dict[str, Any], line: dict[str, Any]) -> None:
    """What is in both, to the bit; keypoints are a list of records in one and a mapping in the other."""
    for name in SAME:
        assert record[name] == line[name], name
    points = {p["name"]: [p["u_px"], p["v_px"], p["visibility"]] for p in record["keypoints"]}
    assert points == line["keypoints"]


def test_records_are_the_label_lines(folder: Path, read: DatasetDict) -> None:
    dataset, lines = Dataset(folder), {line["index"]: line for line in cuboid.read_lines(folder)}
    splits = {"train": "train", "valid": "validation", "test": "test"}
    assert set(read) == set(splits.values())
    for part, split in splits.items():
        indices = [int(dataset.indices[position]) for position in dataset.part(part)]
        assert read[split]["index"] == indices
        for record in read[split]:
            line = lines.pop(record["index"])
            same_labels(record, line)
            with Image.open(folder / line["image"]) as image:
                np.testing.assert_array_equal(np.asarray(record["image"]), np.asarray(image))
    assert not lines


def test_columns_have_the_types_that_the_card_names(folder: Path, read: DatasetDict) -> None:
    """Also where the first rows have no value, as a box of what is out of view."""
    card = DatasetCard.load(folder / "hf" / "README.md")
    named = {feature["name"] for feature in card.data["dataset_info"]["features"]}
    assert {*SAME, "keypoints", "image"} == named == set(read["train"].features)
    assert str(read["test"].features["box_visible_px"]) == "List(Value('int64'))"
    assert any(box is None for split in read.values() for box in split["box_visible_px"])


def test_the_card_says_what_it_is(folder: Path) -> None:
    card = DatasetCard.load(folder / "hf" / "README.md")
    assert card.data.license == "cc-by-4.0"
    assert card.data.size_categories == ["n<1K"]
    assert "keypoint-detection" in card.data.task_categories
    for text in ("brick", "plate", "B1, B2", "sha256sum -c"):
        assert text in card.text


def test_the_card_of_a_run_that_is_ending(tmp_path: Path) -> None:
    """Writers among a scenario's run before the manifest is written; the scenario then has the seed."""
    folder = cuboid.write_dataset(tmp_path / "d")
    (folder / "manifest.json").unlink()
    (folder / "scenario.yaml").write_text("seed: 71\nrenderer: {name: flat}\n")
    HfWriter(HfOptions()).write(Dataset(folder), tmp_path)
    card = DatasetCard.load(tmp_path / "hf" / "README.md")
    assert card.data.license == "unknown"
    for text in ("Seed: 71", "Renderer: flat", f"posse-core {__version__}"):
        assert text in card.text


def test_croissant_is_valid_and_its_records_are_the_label_lines(folder: Path) -> None:
    read = mlcroissant.Dataset(jsonld=str(folder / "hf" / "croissant.json"))
    assert not read.metadata.ctx.issues.errors
    assert not read.metadata.ctx.issues.warnings
    assert read.metadata.date_published == datetime(2027, 3, 31)
    assert read.metadata.version == Dataset(folder).manifest.versions["posse-core"]
    lines = {line["index"]: line for line in cuboid.read_lines(folder)}
    for split in ("train", "validation", "test"):
        for record in read.records(split):
            line = lines.pop(record[f"{split}/index"])
            assert record[f"{split}/image"].size == (cuboid.CAMERA.width_px, cuboid.CAMERA.height_px)
            assert record[f"{split}/spacecraft"].decode() == line["spacecraft"]
            assert (
                record[f"{split}/mask_rle"][f"{split}/mask_rle/counts"].decode()
                == (line["mask_rle"]["counts"])
            )
            for name in ("t_s", "q_cam_from_body", "t_body_cam_m", "box_whole_px"):
                # pandas, by which it reads, rounds the last digit
                np.testing.assert_allclose(record[f"{split}/{name}"], line[name], rtol=1e-13, atol=1e-15)
            names = [point[f"{split}/keypoints/name"].decode() for point in record[f"{split}/keypoints"]]
            assert names == list(line["keypoints"])
    assert not lines


def test_what_is_cited_is_what_posse_asks_for(folder: Path, tmp_path: Path) -> None:
    """CITATION.cff asks for it; a publication of the dataset's own takes its place."""
    asked = yaml.safe_load((Path(__file__).parents[2] / "CITATION.cff").read_text())
    cited = mlcroissant.Dataset(jsonld=str(folder / "hf" / "croissant.json")).metadata.cite_as
    plain = cited.replace("{", "").replace("}", "")
    for text in (asked["title"], asked["authors"][0]["name"], f"version = {asked['version']}"):
        assert text in plain
    assert cited in (folder / "hf" / "README.md").read_text()
    own = "@article{bricks, title = {Bricks}}"
    HfWriter(HfOptions(citation=own)).write(Dataset(folder), tmp_path)
    metadata = json.loads((tmp_path / "hf" / "croissant.json").read_text())
    assert metadata["citeAs"] == own
    assert "datePublished" not in metadata


def test_checksums_are_those_of_all_files(folder: Path) -> None:
    out = folder / "hf"
    subprocess.run(["sha256sum", "--quiet", "-c", "checksums.sha256"], cwd=out, check=True)
    listed = {row.split("  ")[1] for row in (out / "checksums.sha256").read_text().splitlines()}
    there = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert listed == there - {"checksums.sha256"}
    assert {f"hf/{name}" for name in there} == {
        name for name in Dataset(folder).manifest.exports if name.startswith("hf/")
    }


def test_an_earlier_export_leaves_no_image_in_another_split(folder: Path) -> None:
    images = [path.name for path in (folder / "hf").glob("*/*.png")]
    assert sorted(images) == sorted(path.name for path in (folder / "images").iterdir())


def test_bodies_beside_the_target_and_joints(tmp_path: Path) -> None:
    folder = company.write_dataset(tmp_path / "d")
    read = loaded(export(folder), tmp_path / "cache")["train"]
    assert len(read) == len(Dataset(folder))
    for record, line in zip(read, cuboid.read_lines(folder), strict=True):
        assert {body["name"] for body in record["bodies"]} == set(line["bodies"])
        for body in record["bodies"]:
            expected = line["bodies"][body["name"]]
            for name in ("spacecraft", "box_visible_px", "mask_rle", "q_cam_from_body", "t_body_cam_m"):
                assert body[name] == expected[name]
    assert not mlcroissant.Dataset(jsonld=str(folder / "hf/croissant.json")).metadata.ctx.issues.errors


def without(folder: Path, *labels: str) -> Path:
    """Take labels out of a dataset."""
    for path in (folder / "labels").iterdir():
        lines = [json.loads(line) for line in path.read_text().splitlines()]
        kept = [{name: line[name] for name in line if name not in labels} for line in lines]
        path.write_text("".join(json.dumps(line) + "\n" for line in kept))
    return folder


def test_what_no_annotator_made_is_no_column(tmp_path: Path) -> None:
    masks = ("mask_rle", "mask_area_px", "fraction_visible", "fraction_lit")
    folder = without(cuboid.write_dataset(tmp_path / "d"), "keypoints", *masks)
    card = DatasetCard.load(export(folder) / "README.md")
    assert card.data.task_categories == ["object-detection"]
    named = {each["name"] for each in card.data["dataset_info"]["features"]}
    assert named.isdisjoint({"keypoints", *masks})


def test_a_dataset_without_boxes_is_told_what_to_add(tmp_path: Path) -> None:
    folder = without(cuboid.write_dataset(tmp_path / "d"), "box_visible_px")
    with pytest.raises(InputError, match=r"add 'box' to the scenario's annotators"):
        HfWriter(HfOptions()).write(Dataset(folder), tmp_path)


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("licence=mit", "option -o licence=mit: begin it with a format, as in -o hf.KEY=VALUE"),
        ("hf.license=mit", "hf.license: unknown key"),
        ("hf.licence=All rights!", "hf.licence"),
        ("hf.published=soon", "hf.published"),
    ],
)
def test_wrong_options(folder: Path, option: str, said: str) -> None:
    done = CliRunner().invoke(command, [str(folder), "--format", "hf", "-o", option])
    assert done.exit_code
    assert said in str(done.exception)
