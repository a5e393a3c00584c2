"""What a COCO file holds, as far as it is read here."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from posse_core._files.reading import FileRecord

Whole = Annotated[int, Field(strict=False)]
"""A whole number, which some programs write as 3.0."""
Id = Whole | str
Number = float | int
"""A number that stays as it is written."""


class CocoImage(FileRecord):
    """An image."""

    id: Id
    file_name: str
    width: Annotated[Whole, Field(ge=0)]
    height: Annotated[Whole, Field(ge=0)]


class CocoCategory(FileRecord):
    """A kind of object: here, a spacecraft."""

    id: Id
    name: str
    keypoints: list[str] = Field(default_factory=list)


class CocoAnnotation(FileRecord):
    """An object in an image.

    Attributes:
        segmentation: run lengths, or polygons, which are not read.
        keypoints: three numbers for each of the category's: u, v, visibility.
        instance: POSSE's own key: the name of the body, None for the target.
        q_cam_from_body: POSSE's own, as in label lines; with ``t_body_cam_m``.
    """

    id: Id
    image_id: Id
    category_id: Id
    bbox: tuple[Number, Number, Number, Number]
    area: Number | None = None
    segmentation: dict[str, Any] | list[Any] | None = None
    keypoints: list[Number] | None = None
    num_keypoints: Whole | None = None
    instance: str | None = None
    q_cam_from_body: tuple[float, float, float, float] | None = None
    t_body_cam_m: tuple[float, float, float] | None = None


class CocoFile(FileRecord):
    """The file."""

    images: list[CocoImage]
    annotations: list[CocoAnnotation]
    categories: list[CocoCategory]
