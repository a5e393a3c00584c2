"""The labels of one frame as a record and as a line of JSON, with its validation, writing and
reading."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, JsonValue, Strict, ValidationError

from posse_core._errors import InputError
from posse_core._model.run_lengths import RunLengths

Fraction = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=0, strict=True)]
Vector = Annotated[tuple[float, float, float], Strict(False)]
Quaternion = Annotated[tuple[float, float, float, float], Strict(False)]
"""Scalar first."""


class Box(NamedTuple):
    """A box in the image: its left and upper border, and its size, px."""

    x: int | float
    y: int | float
    width: int | float
    height: int | float


class Keypoint(NamedTuple):
    """A keypoint in the image.

    Attributes:
        u_px, v_px: its position, column and row; None behind the camera or beyond the reach of its lens.
        visibility: 0 outside the image, 1 hidden, 2 visible.
    """

    u_px: float | None
    v_px: float | None
    visibility: Literal[0, 1, 2]


class JointReading(BaseModel):
    """A joint that moves, at a reading's instant: its value, rad or m, and rate, rad/s or m/s."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)

    value: float
    rate: float


class BodyReading(BaseModel):
    """Where a body beside the target was at a reading's instant; see :class:`ReadingLabels`.

    Attributes:
        q_sensor_from_body, t_body_sensor_m, v_body_sensor_m_s, omega_body_rad_s: as the target's.
        is_carried: whether the chaser carries the body, which then stays where it is in sensor axes.
        joints: the body's joints that move, by name.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)

    q_sensor_from_body: Quaternion
    t_body_sensor_m: Vector
    v_body_sensor_m_s: Vector
    omega_body_rad_s: Vector
    is_carried: bool = False
    joints: dict[str, JointReading] = Field(default_factory=dict)


class ReadingLabels(BaseModel):
    """One reading of a sensor beside the camera: where the spacecraft was at its instant, and more.

    Attributes:
        t_s: the reading's instant, seconds since the scenario's epoch.
        q_sensor_from_body: attitude of the spacecraft, scalar first, sensor axes from body axes.
        t_body_sensor_m: the spacecraft's origin in sensor axes.
        v_body_sensor_m_s: its velocity relative to the sensor, measured in GCRF axes, in sensor axes.
        omega_body_rad_s, omega_sensor_rad_s: angular velocities against GCRF axes, of the spacecraft in
            body axes and of the sensor in its own.
        files: files of the reading in the dataset's folder.
        labels: what the sensor itself labels.
        joints: the spacecraft's joints that move, by name.
        bodies: the bodies beside the spacecraft, by name.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)

    t_s: float
    q_sensor_from_body: Quaternion
    t_body_sensor_m: Vector
    v_body_sensor_m_s: Vector
    omega_body_rad_s: Vector
    omega_sensor_rad_s: Vector
    files: Annotated[tuple[str, ...], Strict(False)] = ()
    labels: dict[str, JsonValue] = Field(default_factory=dict)
    joints: dict[str, JointReading] = Field(default_factory=dict)
    bodies: dict[str, BodyReading] = Field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The labels as a mapping for :func:`json.dumps`, without joints and bodies where there are
        none."""
        moving = {"joints", "bodies"}
        return {
            **self.model_dump(exclude=moving),
            **self.model_dump(include=moving, exclude_defaults=True),
        }


class LabelNotMade(InputError, AttributeError):
    """A frame lacks a label: the scenario did not choose the annotator that makes it, or the dataset was
    read from a COCO file, which has few labels."""


class _NotMade:
    """Stands for a label that was not made, but only in the signature."""

    def __repr__(self) -> str:
        return "not made"


_NOT_MADE: Final[Any] = _NotMade()


def _made_by(annotator: str) -> Any:
    """The default of a label that one of the core's annotators makes."""
    return Field(_NOT_MADE, json_schema_extra={"annotator": annotator})


class JointLabels(BaseModel):
    """A joint that moves, at a frame's instant, and where what it carries is.

    Attributes:
        value: rad or m.
        rate: rad/s or m/s.
        q_cam_from_link: attitude of the link that the joint carries, scalar first.
        t_link_cam_m: origin of the link's axes in camera axes; the link's axes are the body's when every
            joint is at zero.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)

    value: float
    rate: float
    q_cam_from_link: Quaternion
    t_link_cam_m: Vector


class FinishLabels(BaseModel):
    """Factors of a material in one frame, and its pattern.

    Attributes:
        base_color: of the base colour in red, green, blue.
        roughness: of the roughness.
        pattern: index of its pattern; None if it has none.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)

    base_color: Vector
    roughness: Annotated[float, Field(gt=0)]
    pattern: Count | None = None


class BodyLabels(BaseModel):
    """The labels of one body in one frame; ``docs/labels.md`` explains each of them.

    A label that is null, such as the box of a body outside the image, is None. A label that was not made
    is absent: reading it raises :class:`LabelNotMade`, and :meth:`has` says whether it is present. The
    labels of plugins' annotators are in :attr:`extras`.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="allow", allow_inf_nan=False)
    __pydantic_extra__: dict[str, dict[str, JsonValue]]

    spacecraft: str = _NOT_MADE
    box_visible_px: Box | None = _made_by("box")
    box_whole_px: Box | None = _made_by("box")
    mask_rle: RunLengths = _made_by("mask")
    mask_area_px: Count = _made_by("mask")
    fraction_visible: Fraction | None = _made_by("mask")
    fraction_lit: Fraction | None = _made_by("mask")
    part_area_px: dict[str, Count] = _made_by("parts")
    keypoints: dict[str, Keypoint] = _made_by("keypoints")
    q_cam_from_body: Quaternion = _made_by("pose")
    t_body_cam_m: Vector = _made_by("pose")
    range_m: Annotated[float, Field(gt=0)] = _made_by("pose")
    phase_angle_rad: Annotated[float, Field(ge=0, le=3.1415926535897936)] = _made_by("pose")
    sun_direction_body: Vector = _made_by("pose")
    v_body_cam_m_s: Vector = _made_by("pose")
    omega_body_rad_s: Vector = _made_by("pose")
    omega_camera_rad_s: Vector = _made_by("pose")
    joints: dict[str, JointLabels] = _made_by("pose")
    is_carried: bool = _made_by("pose")
    flow_duration_s: Annotated[float, Field(gt=0)] | None = _made_by("optical-flow")

    def model_post_init(self, context: Any, /) -> None:
        """Remove labels that were not given, so that reading them calls ``__getattr__``."""
        for name in self.__dict__.keys() - self.model_fields_set:
            del self.__dict__[name]

    if not TYPE_CHECKING:  # a type checker would otherwise accept any attribute

        def __getattr__(self, name: str) -> Any:
            if name in type(self).model_fields:
                raise LabelNotMade(
                    f"{self._described()} has no {name!r}{_way_out(annotator_of(name))}",
                    name=name,
                    obj=self,
                )
            return super().__getattr__(name)

    def _described(self) -> str:
        return f"body of spacecraft {self.__dict__.get('spacecraft')!r}"

    @property
    def extras(self) -> Mapping[str, Mapping[str, JsonValue]]:
        """The labels of plugins' annotators: name of the annotator → its labels by key."""
        return self.__pydantic_extra__

    def has(self, *names: str) -> bool:
        """Whether the labels with these names were made.

        Raises:
            ValueError: there is no label with such a name.
        """
        for name in names:
            if name not in type(self).model_fields:
                raise ValueError(f"there is no label {name!r}")
        return all(name in self.__dict__ for name in names)

    def as_json(self) -> dict[str, Any]:
        """The labels that were made, as a mapping for :func:`json.dumps`, in the order of a line."""
        values = {name: self.__dict__[name] for name in _FIELDS if name in self.__dict__}
        if "mask_rle" in values:
            values["mask_rle"] = dict(self.mask_rle)
        if "joints" in values:
            values["joints"] = {name: joint.model_dump() for name, joint in self.joints.items()}
        return {**values, **self.extras}


class LabelLine(BodyLabels):
    """The labels of one frame: those of the target, of the bodies beside it, and of the frame itself."""

    index: Count
    t_s: float = _NOT_MADE
    epoch_utc: str = _NOT_MADE
    sequence: int = _NOT_MADE
    sun_fraction_target: Fraction = _NOT_MADE
    sun_fraction_camera: Fraction = _NOT_MADE
    solar_flux_w_m2: Annotated[float, Field(ge=0)] = _NOT_MADE
    finishes: dict[str, FinishLabels] = _NOT_MADE
    bodies: dict[str, BodyLabels] = _NOT_MADE
    exposure_s: Annotated[float, Field(gt=0)] = _NOT_MADE
    image: str = _NOT_MADE
    truth: str | None = _NOT_MADE
    origin: tuple[str, Count] = _NOT_MADE
    sensors: dict[str, Annotated[tuple[ReadingLabels, ...], Strict(False)]] = _NOT_MADE

    def _described(self) -> str:
        return f"frame {self.index}"

    def as_json(self) -> dict[str, Any]:
        """The labels that were made, as a mapping for :func:`json.dumps`, in the order of a line."""
        values = super().as_json()
        if "finishes" in values:
            values["finishes"] = {
                name: made.model_dump(exclude_none=True) for name, made in self.finishes.items()
            }
        if "bodies" in values:
            values["bodies"] = {name: body.as_json() for name, body in self.bodies.items()}
        if "sensors" in values:
            values["sensors"] = {
                name: [reading.as_json() for reading in readings]
                for name, readings in self.sensors.items()
            }
        return values

    @property
    def instances(self) -> dict[str | None, BodyLabels]:
        """The labels of all bodies: those of the target under None, then those of the bodies beside it
        under their names."""
        instances: dict[str | None, BodyLabels] = {None: self}
        if self.has("bodies"):
            instances.update(self.bodies)
        return instances

    @property
    def files(self) -> tuple[str, ...]:
        """The files of the frame in the dataset's folder: image, arrays, and those of sensors."""
        own = [self.__dict__.get(name) for name in ("image", "truth")]
        readings = [reading for each in self.__dict__.get("sensors", {}).values() for reading in each]
        return (
            *(name for name in own if name is not None),
            *(name for reading in readings for name in reading.files),
        )

    def to_json(self) -> bytes:
        """One line of JSON, UTF-8, without its line feed.

        Raises:
            ValueError: an extra is not a finite number.
        """
        text = json.dumps(self.as_json(), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        return text.encode()

    @classmethod
    def from_json(cls, line: bytes) -> LabelLine:
        """Read a label line of a dataset.

        Raises:
            InputError: the line is not valid, or lacks a label of :data:`IN_EVERY_LINE`; the message
                names the first key at fault.
        """
        try:
            labels = cls.model_validate_json(line)
        except ValidationError as error:
            raise InputError(first_fault(error)) from None
        for name in IN_EVERY_LINE:
            if name not in labels.__dict__:
                raise InputError(f"{name}: field required")
        if any(isinstance(x, float) for x in labels.__dict__.get("box_visible_px") or ()):
            raise InputError("box_visible_px: input should be whole numbers")
        if (key := next(labels._not_finite(), None)) is not None:
            raise InputError(f"{key}: input should be a finite number")
        return labels

    def _not_finite(self) -> Iterator[str]:
        """Keys of numbers that are not finite, in labels of plugins and sensors, whose form is free."""
        yield from _not_finite(self.__pydantic_extra__ or {}, "")
        for name, body in self.__dict__.get("bodies", {}).items():
            yield from _not_finite(body.__pydantic_extra__ or {}, f"bodies.{name}.")
        for name, readings in self.__dict__.get("sensors", {}).items():
            for number, reading in enumerate(readings):
                yield from _not_finite(reading.labels, f"sensors.{name}.{number}.labels.")


_BEFORE: Final = ("index", "t_s", "epoch_utc", "sequence", "spacecraft")
_SUNLIGHT: Final = ("sun_fraction_target", "sun_fraction_camera", "solar_flux_w_m2")
_FIELDS: Final = tuple(dict.fromkeys((*_BEFORE, *_SUNLIGHT, *LabelLine.model_fields)))
"""The order of labels in a line of JSON."""

IN_EVERY_LINE: Final = (
    "index",
    "t_s",
    "epoch_utc",
    "sequence",
    "spacecraft",
    "sun_fraction_target",
    "sun_fraction_camera",
    "solar_flux_w_m2",
    "image",
    "truth",
)
"""Labels that every line of a dataset has, whichever annotators were chosen."""


def annotator_of(label: str) -> str | None:
    """The core's annotator that makes a label; None if the run itself does."""
    extra = LabelLine.model_fields[label].json_schema_extra
    return str(extra["annotator"]) if isinstance(extra, dict) else None


def _not_finite(value: object, key: str) -> Iterator[str]:
    """Keys of numbers within a value that are not finite; ``key`` is the value's own, with a dot."""
    if isinstance(value, float) and not math.isfinite(value):
        yield key.removesuffix(".")
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _not_finite(inner, f"{key}{name}.")
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from _not_finite(inner, f"{key}{number}.")


def _way_out(annotator: str | None) -> str:
    return f"; add {annotator!r} to the scenario's annotators" if annotator else ""


def first_fault(error: ValidationError) -> str:
    """The first error of a line, as its key and a message."""
    first = error.errors()[0]
    path = ".".join(str(step) for step in first["loc"])
    return f"{path}: {first['msg'].lower()}" if path else first["msg"].lower()
