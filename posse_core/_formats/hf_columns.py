"""The columns of a dataset as Hugging Face's tools and Croissant take it, in one table.

A column has the name and the value of a label. Where the keys of a label are names, as those of
keypoints are, the column is a list of records with a ``name``, since all rows have the same columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from posse_core._dataset.dataset import Dataset
from posse_core._model.label_line import BodyLabels, LabelLine

NumberType = Literal["int64", "float64", "string"]


@dataclass(frozen=True)
class Column:
    """A column, or a member of the records in one.

    Attributes:
        name: that of the label.
        about: what it is, with its unit.
        type: of the values; None for records.
        is_list: whether a row has a list of such values or records.
        members: of a record.
    """

    name: str
    about: str
    type: NumberType | None = None
    is_list: bool = False
    members: tuple[Column, ...] = ()


def _vector(name: str, about: str, type_: NumberType = "float64") -> Column:
    return Column(name, about, type_, is_list=True)


FILE_NAME: Final = Column("file_name", "file of the image, beside the list of its split", "string")
_FRAME: Final = (
    Column("index", "index of the frame", "int64"),
    Column("sequence", "continuous relative orbit that the frame is of", "int64"),
    Column("t_s", "time since the scenario's epoch, s", "float64"),
    Column("epoch_utc", "time, UTC", "string"),
    Column("sun_fraction_target", "share of the Sun's disc that the Earth leaves free", "float64"),
    Column("exposure_s", "exposure time, s", "float64"),
)
_BODY: Final = (
    Column("spacecraft", "class", "string"),
    _vector("box_visible_px", "box of the visible pixels: x, y, width, height; null if none", "int64"),
    _vector("box_whole_px", "box of all of it, also beyond the image: x, y, width, height; or null"),
    Column(
        "mask_rle",
        "visible pixels, as compressed run-lengths of COCO",
        members=(
            _vector("size", "height and width of the image, px", "int64"),
            Column("counts", "run-lengths", "string"),
        ),
    ),
    Column("mask_area_px", "number of visible pixels", "int64"),
    Column("fraction_visible", "share that nothing else hides; null if out of view", "float64"),
    Column("fraction_lit", "share of the visible pixels that is in sunlight, or null", "float64"),
    Column(
        "keypoints",
        "keypoints in the image",
        is_list=True,
        members=(
            Column("name", "as in spacecraft/NAME.json", "string"),
            Column("u_px", "position to the right, null behind the camera, px", "float64"),
            Column("v_px", "position downwards, px", "float64"),
            Column("visibility", "0 outside the image, 1 hidden, 2 visible", "int64"),
        ),
    ),
    _vector("q_cam_from_body", "attitude: x_cam = R(q) x_body + t, scalar first, OpenCV's axes"),
    _vector("t_body_cam_m", "position of the body's origin in camera axes, m"),
    Column("range_m", "distance to the body's origin, m", "float64"),
    Column("phase_angle_rad", "angle between Sun and camera, seen from the body, rad", "float64"),
    _vector("sun_direction_body", "direction of the Sun in body axes"),
    _vector("v_body_cam_m_s", "velocity relative to the camera, in camera axes, m/s"),
    _vector("omega_body_rad_s", "angular velocity of the body, in body axes, rad/s"),
    _vector("omega_camera_rad_s", "angular velocity of the camera, in camera axes, rad/s"),
)
NEEDS: Final = ("box_visible_px", "q_cam_from_body", "t_body_cam_m")


def columns_of(dataset: Dataset) -> tuple[Column, ...]:
    """The columns that every frame of a dataset has, after the image's file."""
    frame, body = list(_FRAME), list(_BODY)
    for labels in dataset:
        frame = [column for column in frame if labels.has(column.name)]
        body = [
            column
            for column in body
            if all(instance.has(column.name) for instance in labels.instances.values())
        ]
    columns = (FILE_NAME, *frame, *body)
    if not dataset.bodies:
        return columns
    name = Column("name", "of the body", "string")
    beside = Column("bodies", "bodies beside the target", is_list=True, members=(name, *body))
    return (*columns, beside)


def row(labels: LabelLine, columns: Sequence[Column], file_name: str) -> dict[str, Any]:
    """The values of a frame, by column."""
    values: dict[str, Any] = {FILE_NAME.name: file_name}
    for column in columns[1:]:
        if column.name == "bodies":
            values["bodies"] = [
                {
                    "name": name,
                    **{member.name: _value(body, member.name) for member in column.members[1:]},
                }
                for name, body in labels.instances.items()
                if name is not None
            ]
        else:
            values[column.name] = _value(labels, column.name)
    return values


def _value(labels: BodyLabels, name: str) -> Any:
    value = getattr(labels, name)
    if name == "keypoints":
        members = ("u_px", "v_px", "visibility")
        return [{"name": key, **dict(zip(members, point, strict=True))} for key, point in value.items()]
    if name == "mask_rle":
        return value.model_dump(mode="json")
    return list(value) if isinstance(value, tuple) else value


def features(columns: Sequence[Column]) -> list[dict[str, Any]]:
    """The columns as the key ``dataset_info.features`` of a dataset's card names them."""
    return [_feature(column) for column in columns]


def _feature(column: Column) -> dict[str, Any]:
    content: Any = features(column.members) if column.members else column.type
    if column.is_list:
        return {"name": column.name, "list": content}
    return {"name": column.name, "struct" if column.members else "dtype": content}
