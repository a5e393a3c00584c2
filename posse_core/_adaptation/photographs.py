"""Photographs without labels: what nets find in them, and those with trusted poses as a dataset."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from posse_core._dataset.camera import write_camera
from posse_core._dataset.dataset import digest_of
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import CAMERA, IMAGES
from posse_core._detection.pose_detector import PoseDetector
from posse_core._detection.shapes import Sighting
from posse_core._errors import InputError
from posse_core._evaluation.poses import pose_errors
from posse_core._files.atomic import atomic_folder, sha256, write_json
from posse_core._files.reading import FileRecord, read_record
from posse_core._formats.speed import speed_record
from posse_core._interfaces.trust import ANGLE_RAD, RANGE_SHARE
from posse_core._model.camera import Camera
from posse_core._photos.points import check_photo
from posse_core._recipe.steps import Show

LABELS: Final = "train.json"
"""File of the trusted poses, as SPEED+ names that of a train part."""


@dataclass(frozen=True)
class Photographs:
    """Photographs of one folder, and the camera that took them."""

    files: Sequence[Path]
    camera: Camera

    @property
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of all of them, with their names."""
        return digest_of({path.name: sha256(path) for path in self.files})


class FoundPose(FileRecord):
    """The pose that was found in a photograph, by keypoints and then by the refiner.

    Attributes:
        q_cam_from_body: scalar first, refined.
        t_body_cam_m: position of the body's origin in camera axes, refined.
        keypoints_trust: trust of the pose that the keypoints gave, as of
            :attr:`posse_core.PoseEstimate.trust`.
        refined_trust: of the refined pose.
        agrees: whether both differ by less than a right pose may be wrong.
    """

    q_cam_from_body: tuple[float, float, float, float]
    t_body_cam_m: tuple[float, float, float]
    keypoints_trust: float
    refined_trust: float
    agrees: bool

    @property
    def trust(self) -> float:
        """Least trust of both poses; 0 where they disagree.

        A refiner's covariance says how well drawings fit around its pose, and not that one from the far
        side would fit as well; and where surfaces are not as the mesh has them, wrong poses fit too.
        Keypoints and drawings are rarely wrong in the same way.
        """
        return min(self.keypoints_trust, self.refined_trust) if self.agrees else 0.0


class Found(FileRecord):
    """What was found in a photograph.

    Attributes:
        pose: None if there is none.
    """

    pose: FoundPose | None

    def is_trusted(self, least: float) -> bool:
        """Whether there is a pose with at least so much trust."""
        return self.pose is not None and self.pose.agrees and self.pose.trust >= least


def found_file(photo: Path) -> str:
    """Name of the file that says what was found in a photograph."""
    return f"{photo.name}.json"


def look(photographs: Photographs, detector: PoseDetector, folder: Path, show: Show) -> None:
    """Look for the spacecraft in each photograph that has not been looked at yet.

    Args:
        photographs: to look at, in order.
        detector: that finds poses.
        folder: gets a file for each photograph, when all is known of it.
        show: shows how far it is.

    Raises:
        InputError: a photograph cannot be read, or is not of the camera's size.
    """
    folder.mkdir(exist_ok=True)
    for photo in show.bar(photographs.files, len(photographs.files), "photographs"):
        path = folder / found_file(photo)
        if path.exists():
            continue
        check_photo(photo, photographs.camera)
        seen = detector.sightings(read_image(photo), photographs.camera)
        # The first is the likeliest, and a recipe knows one spacecraft.
        best = next((_found(each) for each in seen if each.pose is not None), None)
        found = Found(pose=best)
        write_json(path, found.model_dump(mode="json"))


def _found(sighting: Sighting) -> FoundPose:
    pose, start = sighting.pose, sighting.start
    assert pose is not None
    assert start is not None  # as there is a pose
    e_t, e_q_rad = pose_errors(
        start.R_cam_from_body,
        start.t_body_cam_m,
        pose.R_cam_from_body,
        pose.t_body_cam_m,
    )
    q, t_m = pose.q_cam_from_body.tolist(), pose.t_body_cam_m.tolist()
    return FoundPose(
        q_cam_from_body=(q[0], q[1], q[2], q[3]),
        t_body_cam_m=(t_m[0], t_m[1], t_m[2]),
        keypoints_trust=start.trust,
        refined_trust=pose.trust,
        agrees=e_t < RANGE_SHARE and e_q_rad < ANGLE_RAD,
    )


def read_found(photographs: Photographs, folder: Path) -> dict[Path, Found]:
    """What :func:`look` has found in each photograph."""
    name = "what 'posse adapt' found in a photograph"
    return {photo: read_record(folder / found_file(photo), Found, name) for photo in photographs.files}


def write_trusted(found: Mapping[Path, Found], least: float, camera: Camera, folder: Path) -> None:
    """Write the photographs with trusted poses as images of SPEED+, with :data:`LABELS`.

    Args:
        found: in each photograph.
        least: trust of a pose that is taken.
        camera: that took them.
        folder: to make.

    Raises:
        InputError: no pose is trusted.
    """
    trusted = {photo: each.pose for photo, each in found.items() if each.is_trusted(least) and each.pose}
    if not trusted:
        most = max((each.pose.trust for each in found.values() if each.pose), default=0.0)
        raise InputError(
            f"--trust {least:g}: no pose in {len(found)} photographs is trusted so much, the most is"
            f" {most:.2f}; label some by 'posse annotate' and give those without --camera"
        )
    with atomic_folder(folder) as new:
        (new / IMAGES).mkdir()
        for photo in trusted:
            shutil.copyfile(photo, new / IMAGES / photo.name)
        write_camera(camera, new / CAMERA)
        records = [
            speed_record(photo.name, pose.q_cam_from_body, pose.t_body_cam_m)
            for photo, pose in trusted.items()
        ]
        write_json(new / LABELS, records)
