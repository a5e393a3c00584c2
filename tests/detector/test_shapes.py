"""Boxes of meshes at poses, against the slabs of a cuboid; and what a refiner's result does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cuboid
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from telling import Labels, Points

import posse_core as posse
from posse_core._arrays import AnyArray
from posse_core._detection.evaluate import evaluate, frames_of, sun_direction_cam
from posse_core._detection.groups import groups
from posse_core._detection.shapes import Shapes
from posse_core._interfaces.refiner import RefinerSetting

pytest.importorskip("faster_coco_eval")
PLATE = np.array([1.4, 1.4, 0.1])
CRAFTS = {"brick": cuboid.cuboid(), "plate": cuboid.cuboid("plate", PLATE)}
IMAGE = np.zeros((cuboid.CAMERA.height_px, cuboid.CAMERA.width_px), np.uint8)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> posse.Dataset:
    crafts = (("brick", cuboid.HALF), ("plate", PLATE))
    return posse.Dataset(cuboid.write_dataset(tmp_path_factory.mktemp("d") / "d", crafts))


def pose(R: np.ndarray, t: np.ndarray) -> posse.PoseEstimate:
    return posse.PoseEstimate(R, t, np.eye(6) * 1e-4, np.ones(8, bool), 1.0)


def true_box(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    _, side = cuboid.slabs(R, t, cuboid.HALF)
    rows, columns = np.nonzero(side >= 0)
    return np.array([columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1])


@pytest.mark.parametrize("t", [(0.2, -0.1, 9.0), (4.0, 0.5, 8.0), (-2.9, 2.4, 6.0), (0.0, 0.0, 60.0)])
def test_the_box_is_that_of_the_pixels_that_the_mesh_covers(t: tuple[float, ...]) -> None:
    """Within the image, and cut off by its right, left and lower border."""
    for seed in range(4):
        R = Rotation.random(random_state=seed).as_matrix()
        box = Shapes(CRAFTS).box_px("brick", pose(R, np.array(t)), cuboid.CAMERA)
        np.testing.assert_array_equal(box, true_box(R, np.array(t)))


@pytest.mark.parametrize("outside_m", [-0.3, 1e-9, 0.2])
def test_a_camera_on_the_mesh_or_within_it_sees_no_box(outside_m: float) -> None:
    """A camera that looks at a brick's upper side along its normal sees it everywhere from 0.2 m."""
    t = np.array([0.0, 0.0, cuboid.HALF[2] + outside_m])
    box = Shapes(CRAFTS).box_px("brick", pose(np.diag([1.0, -1.0, -1.0]), t), cuboid.CAMERA)
    if outside_m < 0.1:
        assert box is None
    else:
        whole = [0, 0, cuboid.CAMERA.width_px, cuboid.CAMERA.height_px]
        np.testing.assert_array_equal(box, whole)


def test_through_a_lens_the_box_is_where_opencv_projects_the_corners() -> None:
    """The corners of a brick that is wholly in view are within a pixel of the box's sides."""
    cv2 = pytest.importorskip("cv2")
    lens = posse.BrownConrady(k1=-0.3, k2=0.08)
    camera = replace(cuboid.CAMERA, distortion=lens)
    R, t = Rotation.random(random_state=5).as_matrix(), np.array([1.6, 1.0, 7.0])
    uv, _ = cv2.projectPoints(
        cuboid.corners(), cv2.Rodrigues(R)[0], t, camera.matrix, camera.distortion_coefficients
    )
    low, high = uv[:, 0].min(axis=0), uv[:, 0].max(axis=0)
    box = Shapes(CRAFTS).box_px("brick", pose(R, t), camera)
    assert box is not None
    assert np.abs(box[:2] - low).max() < 1.1
    assert np.abs(box[:2] + box[2:] - 1 - high).max() < 1.1
    straight = Shapes(CRAFTS).box_px("brick", pose(R, t), cuboid.CAMERA)
    assert np.abs(box - straight).max() > 2


@pytest.mark.parametrize("t", [(0.0, 0.0, -9.0), (80.0, 0.0, 9.0)])
def test_out_of_view_there_is_no_box(t: tuple[float, ...]) -> None:
    assert Shapes(CRAFTS).box_px("brick", pose(np.eye(3), np.array(t)), cuboid.CAMERA) is None


@pytest.mark.parametrize("distortion", [None, posse.BrownConrady(k1=-0.3, k2=0.08)])
def test_the_extent_is_the_box_but_for_thin_ends(distortion: posse.BrownConrady | None) -> None:
    """Of a brick wholly in view, whose corners are no thinner than two pixels where they end."""
    camera = replace(cuboid.CAMERA, distortion=distortion)
    shapes = Shapes(CRAFTS)
    for seed in range(20):
        there = pose(Rotation.random(random_state=seed).as_matrix(), np.array([0.2, -0.1, 9.0]))
        exact, found = shapes.box_px("brick", there, camera), shapes.extent_px("brick", there, camera)
        assert np.abs(found[:2] - exact[:2]).max() <= 2
        assert np.abs(found[:2] + found[2:] - exact[:2] - exact[2:]).max() <= 2


@pytest.mark.parametrize(
    "t", [(4.0, 0.5, 8.0), (0.0, 0.0, -9.0), (80.0, 0.0, 9.0), (0.5, 0.0, 0.9), (0.0, 0.0, 0.05)]
)
def test_the_extent_is_within_the_image_and_there_where_a_box_is(t: tuple[float, ...]) -> None:
    """Cut off, behind the camera, beside the image, partly behind the camera, and around the camera."""
    there = pose(Rotation.random(random_state=1).as_matrix(), np.array(t))
    exact = Shapes(CRAFTS).box_px("brick", there, cuboid.CAMERA)
    found = Shapes(CRAFTS).extent_px("brick", there, cuboid.CAMERA)
    assert (found is None) == (exact is None)
    if found is not None and exact is not None:
        assert np.all(found[:2] >= 0)
        assert np.all(found[:2] + found[2:] <= [cuboid.CAMERA.width_px, cuboid.CAMERA.height_px])
        assert np.all(found[:2] <= exact[:2])
        assert np.all(found[:2] + found[2:] >= exact[:2] + exact[2:])


def test_the_meshs_box_counts_where_it_agrees_with_the_nets() -> None:
    R, t = np.eye(3), np.array([0.0, 0.0, 9.0])
    shapes, true = Shapes(CRAFTS), true_box(R, t).astype(float)
    near = posse.Detection("brick", 0.9, true + np.array([3.0, 2.0, -2.0, 3.0]))
    far = posse.Detection("brick", 0.9, true + np.array([30.0, 0.0, 0.0, 0.0]))
    seen = shapes.seen(IMAGE, near, [pose(R, t)], cuboid.CAMERA)
    np.testing.assert_array_equal(seen.detection.box_px, true)
    assert seen.pose is not None
    assert seen.pose.detection is seen.detection
    assert shapes.seen(IMAGE, far, [pose(R, t)], cuboid.CAMERA).detection is far
    unknown = replace(near, label="drum")
    assert shapes.seen(IMAGE, unknown, [pose(R, t)], cuboid.CAMERA).detection is unknown
    assert shapes.seen(IMAGE, near, [], cuboid.CAMERA).pose is None


class Exact(posse.Refiner):
    """Knows the pose, and accepts it, or leaves a share of its certainty to the start."""

    opened: list[posse.Camera]

    def __init__(self, truth: posse.PoseEstimate, *, accepts: bool, left: float = 0.7) -> None:
        super().__init__(posse.NoOptions())
        self.truth, self.accepts, self.left, self.is_closed = truth, accepts, left, False
        self.suns: list[np.ndarray | None] = []

    def open(self, setting: RefinerSetting) -> None:
        raise NotImplementedError

    def refine(
        self,
        image: AnyArray,
        starts: Sequence[posse.PoseEstimate],
        sun_direction_cam: np.ndarray | None = None,
        box_px: np.ndarray | None = None,
    ) -> posse.Refinement:
        self.suns.append(sun_direction_cam)
        pose = self.truth if self.accepts else starts[0]
        return posse.Refinement(pose, self.accepts, 0.9, 0.5, self.left)

    def close(self) -> None:
        self.is_closed = True


@pytest.mark.parametrize("accepts", [True, False])
def test_a_refined_pose_counts_if_it_was_accepted(*, accepts: bool) -> None:
    R, t = np.eye(3), np.array([0.0, 0.0, 9.0])
    refiner = Exact(pose(R, t), accepts=accepts)
    shapes = Shapes(CRAFTS, lambda craft, camera: refiner)
    off = pose(R, t + np.array([0.9, 0.0, 0.0]))
    net = posse.Detection("brick", 0.9, true_box(R, t) + np.array([-18.0, 0.0, 0.0, 0.0]))
    seen = shapes.seen(IMAGE, net, [off], cuboid.CAMERA, np.array([0.0, 0.0, -1.0]))
    assert seen.start is off
    assert seen.refinement is not None
    assert seen.refinement.is_better is accepts
    assert seen.pose is not None
    np.testing.assert_array_equal(seen.pose.t_body_cam_m, t if accepts else off.t_body_cam_m)
    # The boxes overlap little: the mesh's is trusted for the refinement's sake.
    box = true_box(R, t) if accepts else net.box_px
    np.testing.assert_array_equal(seen.detection.box_px, box)
    assert refiner.suns[0] is not None
    shapes.close()
    assert refiner.is_closed


def test_a_pose_that_the_refiner_refused_is_as_certain_as_it_leaves_it() -> None:
    R, t = np.eye(3), np.array([0.0, 0.0, 9.0])
    off = replace(pose(R, t + np.array([0.1, 0.0, 0.0])), certainty=0.8)
    net = posse.Detection("brick", 0.9, true_box(R, t))
    refiners = [Exact(pose(R, t), accepts=False, left=left) for left in (1.0, 0.3)]
    shapes = [Shapes(CRAFTS), *(Shapes(CRAFTS, lambda craft, camera, r=r: r) for r in refiners)]
    seen = [each.seen(IMAGE, net, [off], cuboid.CAMERA).pose for each in shapes]
    assert [None if each is None else each.certainty for each in seen] == [0.8, 0.8, 0.3 * 0.8]


def test_a_refined_pose_that_is_not_certain_moves_no_box_far() -> None:
    R, t = np.eye(3), np.array([0.0, 0.0, 9.0])
    net = posse.Detection("brick", 0.9, true_box(R, t) + np.array([-18.0, 0.0, 0.0, 0.0]))
    off = pose(R, t + np.array([0.9, 0.0, 0.0]))
    for certainty, box in ((0.9, true_box(R, t)), (0.1, net.box_px)):
        refiner = Exact(replace(pose(R, t), certainty=certainty), accepts=True)
        shapes = Shapes(CRAFTS, lambda craft, camera, made=refiner: made)
        seen = shapes.seen(IMAGE, net, [off], cuboid.CAMERA)
        np.testing.assert_array_equal(seen.detection.box_px, box)


def test_a_refiner_is_kept_open_while_the_camera_is_the_same() -> None:
    R, t = np.eye(3), np.array([0.0, 0.0, 9.0])
    opened: list[Exact] = []

    def opener(craft: posse.Spacecraft, camera: posse.Camera) -> posse.Refiner:
        opened.append(Exact(pose(R, t), accepts=True))
        return opened[-1]

    shapes, net = Shapes(CRAFTS, opener), posse.Detection("brick", 0.9, true_box(R, t))
    other = replace(cuboid.CAMERA, fx_px=151.0)
    for camera in (cuboid.CAMERA, cuboid.CAMERA, other):
        shapes.seen(IMAGE, net, [pose(R, t)], camera)
    assert [each.is_closed for each in opened] == [True, False]


def test_boxes_that_are_off_are_put_right_by_the_poses(dataset) -> None:
    """Of a net whose boxes are shifted by 3 pixels, and whose keypoints are right."""
    shifted, frames = Labels(dataset, shift_px=3), frames_of(dataset, "all")
    before = groups(dataset, evaluate(dataset, frames, shifted, Points(dataset)))[0].metrics
    after = groups(dataset, evaluate(dataset, frames, shifted, Points(dataset), Shapes(CRAFTS)))
    # Of one brick fewer than four corners are in the image, so it has no pose and keeps its box.
    assert after[0].metrics["mAP"] > 0.9 > 0.8 > before["mAP"]
    assert after[0].metrics["box IoU median"] == 1 > before["box IoU median"]
    assert "refined" not in after[0].metrics


def test_what_refinement_changed_is_measured(dataset) -> None:
    """Keypoints are 2 pixels off; half of the poses are refined, to the truth, with the labelled Sun."""

    class Off(Points):
        def find(self, image, detections):
            found = super().find(image, detections)
            return [replace(d, keypoints_px=d.keypoints_px + np.array([2.0, 0])) for d in found]

    class Every(Exact):
        def refine(self, image, starts, sun_direction_cam=None, box_px=None):
            line = labels.line(image)
            R = Rotation.from_quat(np.roll(line.q_cam_from_body, -1)).as_matrix()
            if sun_direction_cam is not None:
                np.testing.assert_allclose(R.T @ sun_direction_cam, line.sun_direction_body, atol=1e-9)
            self.truth = replace(starts[0], R_cam_from_body=R, t_body_cam_m=np.array(line.t_body_cam_m))
            self.accepts = line.index % 2 == 0
            return super().refine(image, starts, sun_direction_cam)

    labels, refiner = Labels(dataset), Every(pose(np.eye(3), np.zeros(3)), accepts=True)
    shapes = Shapes(CRAFTS, lambda craft, camera: refiner)
    judged = evaluate(dataset, frames_of(dataset, "all"), labels, Off(dataset), shapes)
    metrics = groups(dataset, judged)[0].metrics
    started = [j.labels.index % 2 == 0 for j in judged for body in j.bodies if body.start is not None]
    assert metrics["refined"] == pytest.approx(np.mean(started))
    assert 0 < metrics["refined"] < 1
    assert metrics["worsened"] == 0
    assert metrics["e_t before"] > 1e-3
    assert min(body.pose.e_t for j in judged for body in j.bodies) < 1e-9


def test_the_sun_is_not_known_in_shadow_between_lamps_and_without_labels(dataset) -> None:
    line = dataset[0]
    assert sun_direction_cam(line) is not None
    keys = {"q_cam_from_body": line.q_cam_from_body, "sun_direction_body": line.sun_direction_body}
    assert sun_direction_cam(posse.LabelLine(index=0, **keys)) is not None
    assert sun_direction_cam(posse.LabelLine(index=0, **keys, sun_fraction_target=0.0)) is None
    assert sun_direction_cam(posse.LabelLine(index=0, **keys, solar_flux_w_m2=50.0)) is not None
    in_a_laboratory = posse.LabelLine(index=0, **keys, solar_flux_w_m2=1e-3)
    assert sun_direction_cam(in_a_laboratory) is None
    assert sun_direction_cam(posse.LabelLine(index=0)) is None
