"""A PyTorch dataset of frames with their poses, for datasets of POSSE, COCO, SPEED and SPEED+."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import NamedTuple, Protocol

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from posse_core import (
    AnyArray,
    Camera,
    FloatArray,
    InputError,
    camera_beside,
    open_dataset,
    read_image,
    read_poses,
)

TANGO = "tango"
"""The class of the only spacecraft of SPEED and SPEED+."""


class PoseSample(NamedTuple):
    """One frame, whose fields PyTorch's default collate stacks into batches. Unknown values are NaN.

    They are those of the target; bodies beside it are in the image alone.

    Pixel coordinates have the centre of the top-left pixel at (0, 0), as in OpenCV. P is the largest
    number of keypoints that a class has.

    Attributes:
        image: (C, H, W) float32, 0 … 1, C = 1 grey or 3 red-green-blue.
        name: name of the image file.
        K: (3, 3) float32 camera matrix, pixels.
        distortion: (n,) float32 coefficients as OpenCV takes them: k₁, k₂, p₁, p₂, k₃ of Brown and
            Conrady, with k₄, k₅, k₆ for a rational lens, or k₁, k₂, k₃, k₄ of a fisheye
            (:attr:`posse_core.Camera.distortion_coefficients`).
        label: () int64 index into :attr:`PoseDataset.classes`; −1 where the labels name no spacecraft.
        q_cam_from_body: (4,) float32, scalar first: x_cam = R(q) x_body + t.
        t_body_cam_m: (3,) float32 position of the body's origin in OpenCV's camera axes.
        keypoints_px: (P, 2) float32, in the order of :attr:`PoseDataset.keypoints_body_m`.
        visibility: (P,) int64 of the keypoints: 0 outside the image, not labelled or padding; 1 hidden;
            2 visible; −1 inside the image, but not known whether visible.
        box_px: (4,) float32 visible box: x, y, width, height.
    """

    image: Tensor
    name: str
    K: Tensor
    distortion: Tensor
    label: Tensor
    q_cam_from_body: Tensor
    t_body_cam_m: Tensor
    keypoints_px: Tensor
    visibility: Tensor
    box_px: Tensor


class PoseDataset(torch.utils.data.Dataset[PoseSample]):
    """Frames with their poses. The path can name


    - the folder of a dataset that ``posse run`` made;
    - a COCO folder with ``train.json``, or one COCO file;
    - labels of SPEED or SPEED+, such as ``speedplus/synthetic/train.json``, or their folder. Images are
      in ``images/``, in ``images/train/`` (SPEED), or beside the labels; ``camera.json`` is beside the
      labels or one folder above.

    Where labels have no keypoints, those of the spacecraft are projected by pose and camera.

    Attributes:
        classes: names of the spacecraft.
        keypoints_body_m: class → (K, 3) keypoints, metres, body axes; (0, 3) where none are known.
    """

    def __init__(
        self,
        path: Path | str,
        part: str = "all",
        *,
        camera: Camera | None = None,
        keypoints_body_m: Mapping[str, FloatArray] | None = None,
    ) -> None:
        """Open a dataset. Images are read when a frame is accessed.

        Args:
            path: a folder or file of one of the kinds above.
            part: ``train``, ``valid``, ``test`` or ``all``; in a folder of SPEED, the name of the
                file of labels.
            camera: camera of the images, if the dataset has no ``camera.json``. SPEED has none; use
                ``posse_core.preset_camera("speed")``.
            keypoints_body_m: class → (K, 3), for spacecraft whose keypoints the dataset does not have,
                such as that of SPEED and SPEED+, whose class is ``tango``.

        Raises:
            InputError: The path is none of these, there is no such part, or a camera is missing.
        """
        path = Path(path)
        labels = path if path.suffix == ".json" else path / f"{part}.json"
        if part == "all" and _holds_list(path / "train.json"):
            raise InputError(
                f"{path}: has a file of labels for each part; choose one, such as part='train'"
            )
        self._source: _Source = (
            _Speed(labels, camera) if _holds_list(labels) else _Posse(path, part, camera)
        )
        given = dict(keypoints_body_m or {})
        self.classes: tuple[str, ...] = tuple(self._source.keypoints_body_m)
        self.keypoints_body_m: dict[str, FloatArray] = {
            name: points if len(points) else _points(given.pop(name, points), name)
            for name, points in self._source.keypoints_body_m.items()
        }
        if given:
            raise InputError(
                f"keypoints_body_m: {path} has no spacecraft {', '.join(given)} without keypoints; it"
                f" has {', '.join(self.classes)}"
            )
        self._count = max(map(len, self.keypoints_body_m.values()))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._source)

    def __getitem__(self, index: int) -> PoseSample:
        """Return the frame at a position in the dataset, counted from 0.

        Raises:
            IndexError: There is no such frame.
            InputError: Its image is missing, or its size is not that of the camera.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        labels, image = self._source.labels(index % len(self)), self._source.image(index % len(self))
        camera = self._source.camera
        height, width = image.shape[:2]
        if camera is not None and labels.q_cam_from_body is not None and labels.keypoints is None:
            known = self._projected(labels, camera, height, width)
        else:
            known = np.zeros((0, 3)) if labels.keypoints is None else labels.keypoints
        keypoints = np.concatenate([known, np.tile([np.nan, np.nan, 0], (self._count - len(known), 1))])
        planes = image[None] if image.ndim == 2 else np.moveaxis(image, 2, 0)
        full_scale = np.float32(np.iinfo(image.dtype).max)
        return PoseSample(
            image=torch.from_numpy(planes.astype(np.float32) / full_scale),
            name=labels.name,
            K=_tensor(None if camera is None else camera.matrix, 3, 3),
            distortion=_tensor(None if camera is None else camera.distortion_coefficients, 5),
            label=torch.tensor(-1 if labels.craft is None else self.classes.index(labels.craft)),
            q_cam_from_body=_tensor(labels.q_cam_from_body, 4),
            t_body_cam_m=_tensor(labels.t_body_cam_m, 3),
            keypoints_px=_tensor(keypoints[:, :2], self._count, 2),
            visibility=torch.from_numpy(keypoints[:, 2].astype(np.int64)),
            box_px=_tensor(labels.box_px, 4),
        )

    def _projected(self, labels: _Labels, camera: Camera, height: int, width: int) -> FloatArray:
        """Return (K, 3) u, v and visibility of the spacecraft's keypoints."""
        points = np.zeros((0, 3)) if labels.craft is None else self.keypoints_body_m[labels.craft]
        q = np.asarray(labels.q_cam_from_body, np.float64)
        R = Rotation.from_quat(q[[1, 2, 3, 0]]).as_matrix()
        uv = camera.project(points @ R.T + np.asarray(labels.t_body_cam_m))
        inside = ((uv > -0.5) & (uv < [width - 0.5, height - 0.5])).all(axis=1)  # false for NaN
        return np.column_stack([uv, np.where(inside, -1, 0)])


class _Labels(NamedTuple):
    """The labels that a source has for a frame. ``keypoints`` are (K, 3) u, v, visibility."""

    name: str
    craft: str | None
    q_cam_from_body: Sequence[float] | FloatArray | None
    t_body_cam_m: Sequence[float] | FloatArray | None
    keypoints: FloatArray | None = None
    box_px: FloatArray | None = None


class _Source(Protocol):
    """A source of frames; positions count them from 0."""

    @property
    def camera(self) -> Camera | None: ...

    @property
    def keypoints_body_m(self) -> Mapping[str, FloatArray]: ...

    def __len__(self) -> int: ...

    def labels(self, position: int) -> _Labels: ...

    def image(self, position: int) -> AnyArray: ...


class _Posse:
    """A dataset that ``posse run`` made, or COCO."""

    def __init__(self, path: Path, part: str, camera: Camera | None) -> None:
        self._dataset = open_dataset(path)
        if camera is None and (self._dataset.folder / "camera.json").exists():
            camera = self._dataset.camera
        self.camera = camera
        everything = range(len(self._dataset))
        self._positions = everything if part == "all" else self._dataset.part(part)
        self.keypoints_body_m = {
            name: np.array(list(craft.keypoints_body_m.values()), np.float64).reshape(-1, 3)
            for name, craft in sorted(self._dataset.spacecraft_by_name.items())
        }

    def __len__(self) -> int:
        return len(self._positions)

    def labels(self, position: int) -> _Labels:
        line = self._dataset[self._positions[position]]
        box = line.box_visible_px if line.has("box_visible_px") else None
        keypoints = None
        if line.has("keypoints"):
            keypoints = np.array(list(line.keypoints.values()), np.float64).reshape(-1, 3)
        return _Labels(
            name=line.image,
            craft=line.spacecraft if line.has("spacecraft") else None,
            q_cam_from_body=line.q_cam_from_body if line.has("q_cam_from_body") else None,
            t_body_cam_m=line.t_body_cam_m if line.has("t_body_cam_m") else None,
            keypoints=keypoints,
            box_px=None if box is None else np.array(box, np.float64),
        )

    def image(self, position: int) -> AnyArray:
        return self._dataset.image(self._positions[position])


class _Speed:
    """SPEED or SPEED+: poses from the file ``labels``, images in a folder beside it."""

    def __init__(self, labels: Path, camera: Camera | None) -> None:
        self._poses = read_poses(labels)
        found = camera or camera_beside(labels)
        if found is None:
            raise InputError(
                f"{labels}: has no camera.json beside it or above; put SPEED+'s there, or pass a camera,"
                " such as posse_core.preset_camera('speed')"
            )
        self.camera = found
        self.keypoints_body_m = {TANGO: np.zeros((0, 3))}
        names = self._poses.names
        for name in names:
            if PurePath(name).is_absolute() or ".." in PurePath(name).parts:
                raise InputError(f"{labels}: the image {name!r} is outside the labels' folder")
        folders = [labels.parent / "images", labels.parent / "images" / labels.stem, labels.parent]
        folder = next((folder for folder in folders if (folder / names[0]).is_file()), None)
        if folder is None:
            raise InputError(
                f"{labels}: its image {names[0]} is in none of {', '.join(map(str, folders))}"
            )
        self._folder = folder

    def __len__(self) -> int:
        return len(self._poses.names)

    def labels(self, position: int) -> _Labels:
        poses = self._poses
        q, t_m = poses.q_cam_from_body[position], poses.t_body_cam_m[position]
        return _Labels(poses.names[position], TANGO, q, t_m)

    def image(self, position: int) -> AnyArray:
        path = self._folder / self._poses.names[position]
        image = read_image(path)
        found, wanted = image.shape[:2], (self.camera.height_px, self.camera.width_px)
        if found != wanted:
            raise InputError(
                f"{path}: is {found[1]} × {found[0]} pixels, but its camera has"
                f" {wanted[1]} × {wanted[0]}; pass the camera of these images"
            )
        return image


def _holds_list(path: Path) -> bool:
    """Say whether a JSON file holds a list, as SPEED's do, and not an object, as COCO's do."""
    if not path.is_file():
        return False
    with open(path, encoding="utf-8") as text:
        return text.read(256).lstrip()[:1] == "["


def _points(value: FloatArray, name: str) -> FloatArray:
    points = np.asarray(value, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"keypoints_body_m: {name}: has shape {points.shape}, but must have (K, 3)")
    return points


def _tensor(values: Sequence[float] | FloatArray | None, *shape: int) -> Tensor:
    """Return a float32 tensor of a shape, filled with NaN if there are no values."""
    if values is None:
        return torch.full(shape, torch.nan)
    return torch.tensor(np.asarray(values), dtype=torch.float32)
