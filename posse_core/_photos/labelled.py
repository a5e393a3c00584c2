"""Writes photographs with their poses as a dataset of COCO and SPEED."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posse_core import __version__
from posse_core._dataset.camera import write_camera
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import CAMERA, IMAGES, SPACECRAFT, spacecraft_file
from posse_core._dataset.spacecraft import read_spacecraft, write_spacecraft
from posse_core._files.atomic import write_bytes, write_json
from posse_core._formats.coco import category_record
from posse_core._formats.speed import speed_record
from posse_core._model.camera import Camera
from posse_core._model.labels import VISIBLE
from posse_core._model.spacecraft import Spacecraft
from posse_core._photos.box import box_px
from posse_core._photos.overlay import Overlays
from posse_core._photos.solve import PhotoPose

COCO, SPEED, POSES, OVERLAYS = "coco.json", "speed.json", "poses.json", "overlays"


def write_labelled(
    folder: Path, photos: Path, solved: Sequence[PhotoPose], craft: Spacecraft, camera: Camera
) -> None:
    """Write photographs, poses and points into a folder.

    It gets ``images/``, copies of the photographs; ``coco.json`` with points, boxes and poses;
    ``speed.json``; ``camera.json``; ``spacecraft/``; ``poses.json``, which has covariances and residuals
    too; and ``overlays/``, pictures of the poses.

    Args:
        folder: exists, and is empty.
        photos: folder of the photographs.
        solved: with poses.
        craft: the spacecraft in them.
        camera: that took them.
    """
    for name in (IMAGES, SPACECRAFT, OVERLAYS):
        (folder / name).mkdir()
    write_camera(camera, folder / CAMERA)
    write_spacecraft(craft, folder / SPACECRAFT)
    overlays = Overlays(craft, camera)
    for each in solved:
        shutil.copyfile(photos / each.photo, folder / IMAGES / each.photo)
        picture = overlays.picture(read_image(photos / each.photo), each)
        data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
        write_bytes(folder / OVERLAYS / f"{each.photo}.jpg", data)
    write_json(folder / SPEED, [_speed(each) for each in solved])
    write_json(folder / POSES, [pose_record(each) for each in solved])
    write_json(folder / COCO, _coco(solved, craft, camera, folder))


def _image(solved: PhotoPose) -> str:
    return f"{IMAGES}/{solved.photo}"


def _speed(solved: PhotoPose) -> dict[str, Any]:
    assert solved.pose is not None
    return speed_record(
        _image(solved), solved.pose.q_cam_from_body.tolist(), solved.pose.t_body_cam_m.tolist()
    )


def pose_record(solved: PhotoPose) -> dict[str, Any]:
    """The item of ``poses.json``.

    It has the covariance of rotation (rad) and position (m) in camera axes, the residuals (clicked minus
    projected, null where the pose puts a point behind the camera), and the points that do not agree.
    """
    pose = solved.pose
    assert pose is not None
    return {
        "filename": _image(solved),
        "q_cam_from_body": pose.q_cam_from_body.tolist(),
        "t_body_cam_m": pose.t_body_cam_m.tolist(),
        "covariance": pose.covariance.tolist(),
        "residuals_px": {
            name: offset_px.tolist() if np.isfinite(offset_px).all() else None
            for name, offset_px in zip(solved.names, solved.residuals_px, strict=True)
        },
        "left_out": [name for name, fits in zip(solved.names, pose.inliers, strict=True) if not fits],
    }


def _coco(
    solved: Sequence[PhotoPose], craft: Spacecraft, camera: Camera, folder: Path
) -> dict[str, Any]:
    info = read_spacecraft(spacecraft_file(folder, craft.name))
    size = {"width": camera.width_px, "height": camera.height_px}
    images = [{"id": i, "file_name": _image(each), **size} for i, each in enumerate(solved)]
    return {
        "info": {"description": "photographs labelled by POSSE", "version": __version__},
        "images": images,
        "annotations": [_annotation(i, each, craft, camera) for i, each in enumerate(solved)],
        "categories": [category_record(info, 1)],
    }


def _annotation(index: int, solved: PhotoPose, craft: Spacecraft, camera: Camera) -> dict[str, Any]:
    """A keypoint that was not clicked, or does not agree with the pose, is unlabelled."""
    assert solved.pose is not None
    box = box_px(solved.pose, craft, camera)
    kept = {
        name: (*point_px.tolist(), VISIBLE)
        for name, point_px, fits in zip(solved.names, solved.points_px, solved.pose.inliers, strict=True)
        if fits
    }
    points = [kept.get(name, (0.0, 0.0, 0)) for name in craft.keypoints_body_m]
    return {
        "id": index + 1,
        "image_id": index,
        "category_id": 1,
        "bbox": [box.x0, box.y0, box.width, box.height],
        "area": box.width * box.height,
        "iscrowd": 0,
        "keypoints": [x for point in points for x in point],
        "num_keypoints": len(kept),
        "q_cam_from_body": solved.pose.q_cam_from_body.tolist(),
        "t_body_cam_m": solved.pose.t_body_cam_m.tolist(),
    }
