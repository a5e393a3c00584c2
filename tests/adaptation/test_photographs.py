"""Photographs without labels: those with trusted poses become labels by closed forms, others nothing."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import cuboid
import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import posse_core as posse
from posse_core._adaptation.figures import trusting
from posse_core._adaptation.photographs import (
    Found,
    FoundPose,
    Photographs,
    look,
    read_found,
    write_trusted,
)
from posse_core._dataset.dataset import Dataset
from posse_core._detection.pose_detector import PoseDetector
from posse_core._detection.shapes import Shapes
from posse_core._errors import InputError
from posse_core._formats.opening import open_dataset

SURE = (0, 1, 3)
"""Frames whose keypoints are certain; those of the fifth are not, and the last shows nothing."""


class Silent:
    """Shows nothing of how far it is."""

    def begin(self, step: str) -> None: ...
    def expect(self, seconds: Mapping[str, float]) -> None: ...
    def say(self, line: str) -> None: ...
    def bar(self, items: Iterable[Any], total: int, title: str) -> Iterable[Any]:
        return items


class Boxes(posse.Detector):
    """Knows the box of each frame, which it tells apart by what cuboid.write_dataset has drawn."""

    classes = ("brick",)

    def __init__(self, dataset: Dataset) -> None:
        self.known, self.asked = dataset, 0

    def load(self, path):
        raise NotImplementedError  # it knows without a file

    def predict(self, images):
        return [self._found(image) for image in images]

    def _found(self, image):
        if image.shape[0] != cuboid.CAMERA.height_px:  # a part of an image, of which it knows nothing
            return []
        self.asked += 1
        box = self.known[number_of(image)].box_visible_px
        return [] if box is None else [posse.Detection("brick", 0.9, np.array(box, float))]


class Points(posse.KeypointFinder):
    """Knows the keypoints of each frame, and is certain of them in some."""

    classes = ("brick",)
    keypoints_body_m: ClassVar = {"brick": cuboid.corners()}

    def __init__(self, dataset: Dataset) -> None:
        self.known = dataset

    def load(self, path):
        raise NotImplementedError

    def find(self, image, detections):
        frame = number_of(image)
        points = np.array([p[:2] for p in self.known[frame].keypoints.values()])
        sigma_px = np.full(8, 0.05 if frame in SURE else 6.0)
        return [replace(d, keypoints_px=points, keypoints_sigma_px=sigma_px) for d in detections]


def number_of(image: np.ndarray) -> int:
    """The top row of frame i has a bright pixel in every column that i + 2 divides."""
    return int(np.flatnonzero(image[0] == 200)[1]) - 2


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return Dataset(cuboid.write_dataset(tmp_path_factory.mktemp("d") / "d"))


@pytest.fixture(scope="module")
def photographs(dataset: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Photographs:
    folder = tmp_path_factory.mktemp("photos")
    for frame in (0, 1, 3, 4, 5):
        shutil.copy(dataset.folder / f"images/{frame:06d}.png", folder / f"photo-{frame}.png")
    return Photographs(sorted(folder.iterdir()), cuboid.CAMERA)


def test_only_trusted_poses_become_labels_and_these_are_those_of_closed_forms(
    dataset: Dataset, photographs: Photographs, tmp_path: Path
) -> None:
    detector = PoseDetector(Boxes(dataset), Points(dataset))
    look(photographs, detector, tmp_path / "before", Silent())
    found = read_found(photographs, tmp_path / "before")
    assert [path.name for path, each in found.items() if each.pose is None] == ["photo-5.png"]
    write_trusted(found, 0.5, photographs.camera, tmp_path / "trusted")
    made = open_dataset(tmp_path / "trusted", target=cuboid.cuboid())
    assert sorted(made[i].image for i in made.part("train")) == [f"images/photo-{i}.png" for i in SURE]
    for i, frame in enumerate(SURE):
        ours, theirs = made[i], dataset[frame]
        assert np.array_equal(made.image(i), dataset.image(frame))
        np.testing.assert_allclose(ours.q_cam_from_body, theirs.q_cam_from_body, atol=1e-6)
        np.testing.assert_allclose(ours.t_body_cam_m, theirs.t_body_cam_m, atol=1e-5)
        np.testing.assert_allclose(ours.box_visible_px, theirs.box_visible_px, atol=1)
        differ = made.mask(i) != dataset.mask(frame)
        assert differ.sum() <= 0.02 * dataset.mask(frame).sum()  # pixels that the border just meets
        for name, point in theirs.keypoints.items():
            np.testing.assert_allclose(ours.keypoints[name][:2], point[:2], atol=1e-3)
    # Nothing else of the photographs is there.
    assert len(list((tmp_path / "trusted" / "images").iterdir())) == len(SURE)


def test_what_was_looked_at_is_not_looked_at_again(
    dataset: Dataset, photographs: Photographs, tmp_path: Path
) -> None:
    look(photographs, PoseDetector(Boxes(dataset), Points(dataset)), tmp_path / "whole", Silent())
    for record in ("photo-3.png.json", "photo-5.png.json"):
        shutil.copytree(tmp_path / "whole", tmp_path / record)
        (tmp_path / record / record).unlink()
        boxes = Boxes(dataset)
        look(photographs, PoseDetector(boxes, Points(dataset)), tmp_path / record, Silent())
        assert boxes.asked == 1
        assert read_found(photographs, tmp_path / record) == read_found(photographs, tmp_path / "whole")


def test_where_no_pose_is_trusted_the_most_trust_is_told(tmp_path: Path) -> None:
    found = {Path("a.png"): Found(pose=None), Path("b.png"): a_found(0.31, 0.9)}
    found[Path("c.png")] = a_found(0.9, 0.9, agrees=False)
    with pytest.raises(InputError, match=r"--trust 0.5: no pose in 3 .* the most is 0.31") as error:
        write_trusted(found, 0.5, cuboid.CAMERA, tmp_path / "trusted")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "trusted").exists()


def test_a_photograph_of_another_size_is_told(dataset: Dataset, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    cv2.imwrite(str(tmp_path / "photos" / "small.png"), np.zeros((20, 30), np.uint8))
    photographs = Photographs([tmp_path / "photos" / "small.png"], cuboid.CAMERA)
    with pytest.raises(InputError, match=r"small\.png: is 30 × 20 pixels, but the camera 160 × 120"):
        look(photographs, PoseDetector(Boxes(dataset), Points(dataset)), tmp_path / "b", Silent())
    assert not list((tmp_path / "b").iterdir())


def a_found(by_keypoints: float, refined: float, *, agrees: bool = True) -> Found:
    return Found(
        pose=FoundPose(
            q_cam_from_body=(1.0, 0.0, 0.0, 0.0),
            t_body_cam_m=(0.0, 0.0, 9.0),
            keypoints_trust=by_keypoints,
            refined_trust=refined,
            agrees=agrees,
        )
    )


def test_trusted_photographs_are_counted() -> None:
    none = Found(pose=None)
    before = [a_found(0.9, 0.9), a_found(0.6, 0.7), a_found(0.4, 1.0), none, a_found(0.5, 0.5)]
    after = [a_found(0.9, 0.9), a_found(0.9, 0.2), a_found(0.7, 0.8), a_found(0.8, 1.0), none]
    counts = trusting(before, after, 0.5)
    assert (counts.photographs, counts.before, counts.after, counts.kept) == (5, 3, 3, 1)


class Turns(posse.Refiner):
    """Turns each pose about the camera's axis by an angle, and is certain that it is right."""

    def __init__(self, angle_rad: float) -> None:
        self.turn = Rotation.from_rotvec([0, 0, angle_rad]).as_matrix()

    def open(self, setting):
        raise NotImplementedError  # it is given as it is

    def refine(self, image, starts, sun_direction_cam=None, box_px=None):
        (start,) = starts
        turned = self.turn @ start.R_cam_from_body
        pose = replace(start, R_cam_from_body=turned, covariance=1e-9 * np.eye(6))
        return posse.Refinement(pose, True, 0.99, 0.5)

    def close(self): ...


@pytest.mark.parametrize(("angle_deg", "trusted"), [(4.5, len(SURE)), (5.5, 0), (179.0, 0)])
def test_a_refined_pose_that_the_keypoints_contradict_is_not_trusted(
    dataset: Dataset, photographs: Photographs, tmp_path: Path, angle_deg: float, trusted: int
) -> None:
    """However certain it is; nor is one whose keypoints are not certain."""
    refiner = Turns(np.radians(angle_deg))
    shapes = Shapes({"brick": cuboid.cuboid()}, lambda craft, camera: refiner)
    detector = PoseDetector(Boxes(dataset), Points(dataset), shapes=shapes)
    look(photographs, detector, tmp_path / "before", Silent())
    found = read_found(photographs, tmp_path / "before").values()
    assert sum(each.is_trusted(0.5) for each in found) == trusted
    assert sum(each.is_trusted(0.0) for each in found) == (0 if trusted == 0 else 4)
