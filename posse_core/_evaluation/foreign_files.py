"""What files of SPEED, BOP and YOLO-pose hold, as far as they are checked."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Self

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, RootModel

from posse_core._errors import InputError
from posse_core._files.reading import FileRecord
from posse_core._plugins.options import validated
from posse_core._scenario.yaml_lines import YamlText

POSITION: Final = "r_Vo2To_vbs_true"
"""The key of SPEED and SPEED+ by which their files are known."""
_MOST_POINTS: Final = 1000
_Frame = Annotated[int, Field(ge=0, strict=False)]
"""BOP writes the numbers of images as names of keys."""


class SpeedPose(FileRecord):
    """A pose. How many numbers a quaternion and a position have is checked with their values."""

    filename: str
    q_cam_from_body: list[float] = Field(
        default_factory=list, validation_alias=AliasChoices("q_vbs2tango_true", "q_vbs2tango")
    )
    t_body_cam_m: list[float] = Field(validation_alias=POSITION)


class SpeedFile(RootModel[list[SpeedPose]]):
    """The poses of a part of SPEED or SPEED+."""


class BopPose(FileRecord):
    """A pose of ``scene_gt.json``: a matrix by rows, and millimetres."""

    obj_id: int
    cam_R_m2c: Annotated[list[float], Field(min_length=9, max_length=9)]
    cam_t_m2c: Annotated[list[float], Field(min_length=3, max_length=3)]


class BopPoses(RootModel[dict[_Frame, list[BopPose]]]):
    """``scene_gt.json``: number of the image → poses."""


class BopCamera(FileRecord):
    """A camera of ``scene_camera.json``: a matrix by rows, and the millimetres of a depth's unit."""

    cam_K: Annotated[list[float], Field(min_length=9, max_length=9)]
    depth_scale: float = 1.0


class BopCameras(RootModel[dict[_Frame, BopCamera]]):
    """``scene_camera.json``: number of the image → camera."""


class YoloData(BaseModel):
    """``data.yaml`` of YOLO-pose: folders or lists of images, names of classes, and how many keypoints
    there are, of how many values each."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    path: str = "."
    kpt_shape: tuple[Annotated[int, Field(ge=0, le=_MOST_POINTS)], Annotated[int, Field(ge=2, le=3)]]
    names: dict[int, str] | list[str]
    train: str | None = None
    val: str | None = None
    test: str | None = None

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the file.

        Raises:
            InputError: it cannot be read, or a key is wrong; the message names its line.
        """
        text = YamlText.read(path)
        if not isinstance(text.value, dict):
            raise InputError(f"{path}: a data.yaml is a mapping of keys; export it again")
        return validated(cls, text.value, text.where)
