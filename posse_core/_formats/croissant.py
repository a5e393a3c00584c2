"""Croissant: what a dataset is made of, for machines (MLCommons' format 1.0,
doi:10.1145/3650203.3663326)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from typing import Any, Final

from posse_core._formats.hf_columns import FILE_NAME, Column

_TERMS: Final = """
    citeAs column equivalentProperty extract field fileObject fileProperty fileSet format includes
    isLiveDataset jsonPath key md5 parentField path recordSet references regex repeated replace
    samplingRate separator source subField transform
"""
_CONTEXT: Final = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "sc": "https://schema.org/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{term: f"cr:{term}" for term in _TERMS.split()},
}
"""The context that the format prescribes, word for word."""
_TYPES: Final = {"int64": "sc:Integer", "float64": "sc:Float", "string": "sc:Text"}


def croissant(
    *,
    name: str,
    about: str,
    licence: str,
    version: str | None,
    published: date | None,
    citation: str,
    lists: Mapping[str, str],
    columns: Sequence[Column],
) -> dict[str, Any]:
    """The metadata of a folder with a folder for each split, which has images and their list.

    Args:
        name: of the dataset.
        about: a sentence about it.
        licence: identifier, as ``cc-by-4.0``.
        version: of the dataset, as ``1.2.3``; left out if it is None.
        published: day of its publication; left out if it is None.
        citation: of what describes it, in BibTeX.
        lists: split → SHA-256 of its ``metadata.jsonl``.
        columns: of the lists.
    """
    distribution: list[dict[str, Any]] = []
    for split, digest in lists.items():
        distribution += [
            {
                "@type": "cr:FileObject",
                "@id": f"{split}-list",
                "name": f"{split}-list",
                "description": f"The labels of the images of {split}, one line of JSON for each.",
                "contentUrl": f"{split}/metadata.jsonl",
                "encodingFormat": "application/jsonlines",
                "sha256": digest,
            },
            {
                "@type": "cr:FileSet",
                "@id": f"{split}-images",
                "name": f"{split}-images",
                "description": f"The images of {split}.",
                "encodingFormat": "image/png",
                "includes": f"{split}/*.png",
            },
        ]
    known = {
        "version": version,
        "datePublished": None if published is None else published.isoformat(),
        "citeAs": citation,
    }
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": name,
        "description": about,
        "license": licence,
        **{key: value for key, value in known.items() if value is not None},
        "distribution": distribution,
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": split,
                "name": split,
                "description": f"The frames of {split}.",
                "field": [_image(split), *(_field(column, split) for column in columns)],
            }
            for split in lists
        ],
    }


def _image(split: str) -> dict[str, Any]:
    """The image that ``file_name`` refers to."""
    return {
        "@type": "cr:Field",
        "@id": f"{split}/image",
        "name": "image",
        "description": "the image",
        "dataType": "sc:ImageObject",
        "source": {"fileSet": {"@id": f"{split}-images"}, "extract": {"fileProperty": "content"}},
    }


def _field(column: Column, split: str, within: Column | None = None) -> dict[str, Any]:
    """A column, or a member of the records in the column ``within``."""
    path = column.name if within is None else f"{within.name}/{column.name}"
    field: dict[str, Any] = {
        "@type": "cr:Field",
        "@id": f"{split}/{path}",
        "name": column.name,
        "description": column.about,
    }
    if column.is_list or (within is not None and within.is_list):
        field["repeated"] = True
    if column.members:
        # Records within records, such as the keypoints of bodies, are beyond Croissant's paths.
        plain = [member for member in column.members if not member.members]
        return {**field, "subField": [_field(member, split, column) for member in plain]}
    assert column.type is not None
    source: dict[str, Any] = {
        "fileObject": {"@id": f"{split}-list"},
        "extract": {"column": column.name if within is None else within.name},
    }
    if within is not None:
        source["transform"] = {"jsonPath": column.name}
    if column == FILE_NAME:
        name = {"fileSet": {"@id": f"{split}-images"}, "extract": {"fileProperty": "filename"}}
        field["references"] = name
    return {**field, "dataType": _TYPES[column.type], "source": source}
