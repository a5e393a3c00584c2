"""A folder as Hugging Face's ``datasets`` loads it, with a card and Croissant metadata.

It has a folder for each split, with its images and ``metadata.jsonl``, the list of their labels
(huggingface.co/docs/datasets, "ImageFolder"). The card is ``README.md``, whose front matter names
licence, size, splits and the type of every column.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, Final

import yaml
from pydantic import Field

from posse_core import __version__
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import BODIES, CAMERA, MANIFEST, PARTS, SCENARIO, SPACECRAFT
from posse_core._errors import InputError
from posse_core._files.atomic import sha256, write_bytes, write_json
from posse_core._files.reading import parsed_json, read_bytes, read_text
from posse_core._files.text import text_file
from posse_core._formats.croissant import croissant
from posse_core._formats.hf_columns import NEEDS, Column, columns_of, features, row
from posse_core._formats.images import link_or_copy
from posse_core._formats.needs import labels_with
from posse_core._interfaces.writer import Writer
from posse_core._plugins.options import Options

FOLDER: Final = "hf"
_SPLITS: Final = dict(zip(PARTS, ("train", "validation", "test"), strict=True))
"""Part → the name of a split that Hugging Face knows."""
_SIZES: Final = ((10**3, "n<1K"), (10**4, "1K<n<10K"), (10**5, "10K<n<100K"), (10**6, "100K<n<1M"))


class HfOptions(Options):
    """What only the author of a dataset can say."""

    licence: str = Field(
        "unknown",
        pattern=r"^[a-z0-9][a-z0-9.-]*$",
        description="Hugging Face's name of it, as cc-by-4.0",
    )
    published: date | None = Field(None, description="day of publication, as 2027-03-31")
    citation: str | None = Field(
        None, min_length=1, description="BibTeX of what describes the dataset; POSSE's own if not given"
    )


@dataclass(frozen=True)
class Origin:
    """What a dataset was made by.

    Attributes:
        seed: of the run; None if there was more than one.
        renderer: its name.
        versions: of POSSE and of libraries.
    """

    seed: int | None
    renderer: str | None
    versions: Mapping[str, str]

    @property
    def posse(self) -> str | None:
        """The version of POSSE, if it is recorded."""
        return self.versions.get("posse-core")


class HfWriter(Writer[HfOptions]):
    """Writes ``hf/``: the splits' images and lists, ``README.md``, ``croissant.json``, camera and
    spacecraft, and ``checksums.sha256``."""

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write the folder ``hf``."""
        if not len(dataset):
            raise InputError(f"{dataset.folder}: has no frames, so there is nothing to load")
        out = folder / FOLDER
        out.mkdir()
        columns = columns_of(dataset)
        splits = _splits(dataset)
        for split, positions in splits.items():
            _write_split(dataset, positions, columns, out / split)
        _copy(dataset.folder, out)
        name = f"{' and '.join(dataset.spacecraft_by_name)} by POSSE"
        origin = _origin(dataset)
        about = (
            f"{len(dataset)} rendered images of spacecraft, {dataset.camera.width_px} × "
            f"{dataset.camera.height_px} pixels, with exact labels from geometry."
        )
        citation = self.options.citation or _citation(origin.posse)
        lists = {split: sha256(out / split / "metadata.jsonl") for split in splits}
        metadata = croissant(
            name=name,
            about=about,
            licence=self.options.licence,
            version=origin.posse,
            published=self.options.published,
            citation=citation,
            lists=lists,
            columns=columns,
        )
        write_json(out / "croissant.json", metadata)
        sizes = {split: len(positions) for split, positions in splits.items()}
        front = _front_matter(name, self.options.licence, sizes, columns)
        card = _card(name, about, dataset, origin, sizes, columns, citation)
        write_bytes(out / "README.md", f"---\n{front}---\n\n{card}".encode())
        files = sorted(path for path in out.rglob("*") if path.is_file())
        rows = (f"{sha256(path)}  {path.relative_to(out).as_posix()}\n" for path in files)
        write_bytes(out / "checksums.sha256", "".join(rows).encode())
        return [out]


def _splits(dataset: Dataset) -> dict[str, list[int]]:
    """Split → positions of its frames, without empty ones; all are for training if it is not divided."""
    if not dataset.is_divided:
        return {"train": list(range(len(dataset)))}
    found = {split: dataset.part(part) for part, split in _SPLITS.items()}
    return {split: positions for split, positions in found.items() if positions}


def _write_split(
    dataset: Dataset, positions: Sequence[int], columns: Sequence[Column], folder: Path
) -> None:
    folder.mkdir()
    with text_file(folder / "metadata.jsonl") as text:
        for labels in labels_with(dataset, "hf", NEEDS, positions):
            image = dataset.folder / labels.image
            link_or_copy(image, folder / image.name)
            line = row(labels, columns, image.name)
            text.write(json.dumps(line, ensure_ascii=False, allow_nan=False) + "\n")


def _copy(source: Path, out: Path) -> None:
    """Copy what poses and keypoints mean: the camera, and the spacecraft with their meshes."""
    shutil.copyfile(source / CAMERA, out / CAMERA)
    for name in (SPACECRAFT, BODIES):
        for path in sorted((source / name).rglob("*")):
            if path.suffix in (".json", ".ply"):
                target = out / path.relative_to(source)
                target.parent.mkdir(parents=True, exist_ok=True)
                link_or_copy(path, target)


def _origin(dataset: Dataset) -> Origin:
    """By the manifest. A run that is ending writes its manifest last; then this is the version, and the
    scenario has the rest."""
    if (dataset.folder / MANIFEST).exists():
        manifest = dataset.manifest
        renderer = manifest.renderer or {}
        name = renderer.get("name")
        return Origin(manifest.seed, None if name is None else str(name), manifest.versions)
    scenario = yaml.safe_load(read_text(dataset.folder / SCENARIO))
    return Origin(scenario["seed"], scenario["renderer"]["name"], {"posse-core": __version__})


def _front_matter(name: str, licence: str, sizes: Mapping[str, int], columns: Sequence[Column]) -> str:
    """The card's metadata in YAML, by Hugging Face's specification of dataset cards."""
    names = {column.name for column in columns}
    tasks = {"box_visible_px": "object-detection", "keypoints": "keypoint-detection"}
    tasks["mask_rle"] = "image-segmentation"
    count = sum(sizes.values())
    front: dict[str, Any] = {
        "license": licence,
        "pretty_name": name,
        "task_categories": [task for label, task in tasks.items() if label in names],
        "size_categories": [next((size for most, size in _SIZES if count < most), "n>1M")],
        "tags": ["spacecraft", "pose-estimation", "synthetic", "posse"],
        "configs": [
            {
                "config_name": "default",
                "data_files": [{"split": split, "path": f"{split}/**"} for split in sizes],
            }
        ],
        "dataset_info": {
            "features": [{"name": "image", "dtype": "image"}, *features(columns[1:])],
        },
    }
    return yaml.safe_dump(front, sort_keys=False, allow_unicode=True)


_CARD: Final = """\
# {name}

{about} Made by POSSE, an orbital simulator for vision-based rendezvous. The labels are
computed from orbits, attitudes and meshes, and not from the pixels.

```python
from datasets import load_dataset

dataset = load_dataset("FOLDER")   # {sizes}
frame = dataset["{split}"][0]
```

| column | meaning |
|---|---|
| `image` | the image |
{columns}

Pixels count from the centre of the top-left one, (0, 0). Camera axes are OpenCV's: x to the right, y
down, z forward. `camera.json` has the intrinsics with SPEED+'s keys, `spacecraft/NAME.json` the
keypoints in metres, and `NAME.ply` the mesh, both in body axes. `pycocotools.mask.decode` reads masks.

Keypoints by spacecraft:

{crafts}

## Origin

- Renderer: {renderer}
- Seed: {seed}
- Versions: {versions}
- `sha256sum -c checksums.sha256` checks every file.

## Citation

```bibtex
{citation}
```
"""


def _card(
    name: str,
    about: str,
    dataset: Dataset,
    origin: Origin,
    sizes: Mapping[str, int],
    columns: Sequence[Column],
    citation: str,
) -> str:
    """The card's text."""
    keypoints = {
        craft: ", ".join(info.keypoints_body_m) for craft, info in dataset.spacecraft_by_name.items()
    }
    versions = ", ".join(f"{library} {version}" for library, version in origin.versions.items())
    return _CARD.format(
        name=name,
        about=about,
        sizes=", ".join(f"{split}: {size}" for split, size in sizes.items()),
        split=next(iter(sizes)),
        columns="\n".join(f"| `{column.name}` | {column.about} |" for column in columns[1:]),
        crafts="\n".join(f"- `{craft}`: {names or 'none'}" for craft, names in keypoints.items()),
        renderer=origin.renderer or "not recorded",
        seed="not recorded" if origin.seed is None else origin.seed,
        versions=versions or "not recorded",
        citation=citation,
    )


def options_of(folder: Path) -> dict[str, str]:
    """The options with which a folder ``hf`` was written, by its ``croissant.json``.

    Raises:
        InputError: the file is no JSON object.
    """
    path = folder / "croissant.json"
    metadata = parsed_json(read_bytes(path), str(path))
    if not isinstance(metadata, dict):
        raise InputError(f"{path}: no JSON object")
    keys = {"licence": "license", "published": "datePublished", "citation": "citeAs"}
    return {option: metadata[key] for option, key in keys.items() if key in metadata}


def _citation(version: str | None) -> str:
    """How POSSE asks to be cited with a dataset that it made (CITATION.cff), in BibTeX."""
    fields = {
        "author": "{The POSSE authors}",
        "title": "{POSSE}: un{P}erturbed {O}rbital {S}imulator for {S}pac{E}craft",
    }
    if version is not None:
        fields["version"] = version
    rows = ",\n".join(f"  {key} = {{{value}}}" for key, value in fields.items())
    return f"@software{{posse,\n{rows}\n}}"
