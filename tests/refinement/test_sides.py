"""Without a start near the truth and without knowing the light, a pose is found by its looks."""

from __future__ import annotations

import contextlib

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import PoseEstimate, Refinement
from posse_core._evaluation.poses import pose_errors
from posse_core._frames import R_about
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._plugins.loading import load_plugins
from posse_core._refinement.crop import Crop, Picture, scales
from posse_core._refinement.opening import open_refiner
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.sides import Resembling, Sides, by_light_in_windows, first_apart
from posse_core._refinement.studio import Studio
from posse_core._scenario.component import ComponentChoice
from posse_core.testing import refiners
from tests.support.raycast_images import CAMERA, HERE, box_of, light_of, needs_raster

CRAFT = refiners._craft()


def crop_of(seen: np.ndarray, box_px: np.ndarray, larger: float = 1.0) -> Crop:
    """A box, so many times as large, and a quarter of its size beside it."""
    middle = box_px[:2] + box_px[2:] / 2
    box_px = np.concatenate([middle - larger * box_px[2:] / 2, larger * box_px[2:]])
    scale = scales(float(box_px[2:].max()), (48.0, 96.0, 192.0))[0]
    picture = Picture(np.float32(seen), CAMERA, box_px, is_linear=True)
    first, size = box_px[:2], box_px[2:]
    crop = picture.around(first - 0.25 * size, first + 1.25 * size, scale)
    assert crop is not None
    return crop


def seen_at(place: Placement) -> tuple[np.ndarray, np.ndarray]:
    bright, coverage = light_of(CRAFT, place)
    return 0.8 * bright, coverage


@pytest.fixture(scope="module")
def sides() -> Sides:
    studio = Studio(RefinerSetting(CRAFT, CAMERA, refiners._renderer), RenderCompareOptions().renderer)
    return Sides(studio, CRAFT.radius_m)


def is_like(place: Placement, true: Placement) -> bool:
    """Whether steps may lead from a pose to the true one. Of thirty poses at random, 20 degrees apart,
    one is so in one case of seven; of five in one of forty."""
    e_t, e_q = pose_errors(*true, *place)
    return e_t < 0.15 and e_q < np.radians(25)


def always() -> bool:
    return True


def clouds(seed: int) -> np.ndarray:
    """(H, W) patches with sharp edges, as bright as the spacecraft."""
    noise = np.random.default_rng(seed).normal(size=(CAMERA.height_px, CAMERA.width_px))
    patches = cv2.GaussianBlur(noise, (0, 0), 6)
    return 0.1 + 0.5 * (patches > 0.5 * patches.std())


def case(seed: int) -> tuple[Placement, np.ndarray, np.ndarray]:
    """A pose anywhere in the image, in any attitude; brightness and coverage."""
    random = np.random.default_rng(seed)
    R = Rotation.random(random_state=random).as_matrix()
    true = Placement(R, np.array([*random.uniform(-0.4, 0.4, 2), random.uniform(5.5, 9)]))
    return true, *seen_at(true)


@pytest.mark.parametrize("seed", range(4))
def test_a_pose_like_the_true_one_is_among_the_first_that_look_as_the_image_does(
    sides: Sides, seed: int
) -> None:
    """Before a black sky; the range by the keypoints is a tenth too large."""
    true, bright, coverage = case(seed)
    box_px = box_of(coverage > 0.5)
    found = sides.by_light(crop_of(bright, box_px), box_px, 1.1 * true.t_body_cam_m, 5, always)
    assert any(is_like(place, true) for place in found)


def test_before_a_background_it_is_among_thirty_in_most_cases(sides: Sides) -> None:
    """The background grows brighter to one side, to what much of the spacecraft has."""
    hits = []
    for seed in range(4):
        true, bright, coverage = case(seed)
        ramp = np.linspace(0.02, 0.2, CAMERA.width_px)[None]
        box_px = box_of(coverage > 0.5)
        crop = crop_of(bright + (1 - coverage) * ramp, box_px)
        found = sides.by_light(crop, box_px, 1.1 * true.t_body_cam_m, 30, always)
        hits.append(any(is_like(place, true) for place in found))
    assert sum(hits) >= 3


def test_a_box_around_a_part_does_not_hide_the_pose(sides: Sides) -> None:
    """The detected box ends at the middle of the spacecraft: the position by the keypoints tells what
    the box does not."""
    bright, coverage = seen_at(HERE)
    box_px = box_of(coverage > 0.5) * [1, 1, 0.5, 1]
    found = sides.by_light(crop_of(bright, box_px), box_px, HERE.t_body_cam_m, 30, always)
    assert any(is_like(each, HERE) for each in found)
    elsewhere_m = np.array([5.0, 0, 5.0])
    found = sides.by_light(crop_of(bright, box_px), box_px, elsewhere_m, 30, always)
    assert not any(is_like(each, HERE) for each in found)


def test_poses_that_are_found_lie_in_the_box_or_at_the_position_and_differ(sides: Sides) -> None:
    bright, coverage = seen_at(HERE)
    box_px = box_of(coverage > 0.5)
    there_m = 1.2 * HERE.t_body_cam_m
    found = sides.by_light(crop_of(bright, box_px), box_px, there_m, 8, always)
    assert len(found) == 8
    vertices_m = np.concatenate([part.vertices_body_m for part in CRAFT.parts])
    for place in found:
        px = CAMERA.project(vertices_m @ place.R_cam_from_body.T + place.t_body_cam_m)
        low, size = px.min(axis=0), np.ptp(px, axis=0)
        off = np.abs(low + size / 2 - box_px[:2] - box_px[2:] / 2) / box_px[2:].max()
        is_in_box = off.max() < 0.1 and abs(np.log(np.prod(size) / np.prod(box_px[2:]))) < 0.5
        assert is_in_box or np.allclose(place.t_body_cam_m, there_m, rtol=1e-6, atol=1e-6)
    for k, place in enumerate(found):
        turns = [pose_errors(*place, *other)[1] for other in found[:k]]
        assert all(turn > np.radians(20) for turn in turns)


def test_a_box_that_fills_the_crop_leaves_no_background_to_compare_with(sides: Sides) -> None:
    bright, coverage = seen_at(HERE)
    box_px = box_of(coverage > 0.5)
    whole = np.array([-50.0, -50, CAMERA.width_px + 100, CAMERA.height_px + 100])
    assert sides.by_light(crop_of(bright, box_px), whole, HERE.t_body_cam_m, 8, always) == []


@pytest.mark.parametrize("larger", [1.0, 1.25, 1.6])
@pytest.mark.parametrize("seed", range(4))
def test_a_pose_like_the_true_one_is_among_the_first_by_edges_wherever_its_box_lies(
    sides: Sides, seed: int, larger: float
) -> None:
    """The detected box is around a part of the spacecraft, off its middle."""
    true, bright, coverage = case(seed)
    whole = box_of(coverage > 0.5)
    box_px = np.concatenate([whole[:2] + 0.3 * (1 - 1 / larger) * whole[2:], whole[2:] / larger])
    crop = crop_of(bright, box_px, larger)
    found = first_apart(sides.by_edges(crop, box_px, larger, always), crop, 3)
    assert any(is_like(place, true) for place in found)


def test_in_front_of_clouds_a_pose_like_the_true_one_is_among_the_first_by_edges(sides: Sides) -> None:
    """The clouds are as bright, and their edges as sharp."""
    hits = []
    for seed in range(4):
        true, bright, coverage = case(seed)
        box_px = box_of(coverage > 0.5)
        crop = crop_of(bright + (1 - coverage) * clouds(seed), box_px)
        found = first_apart(sides.by_edges(crop, box_px, 1.0, always), crop, 5)
        hits.append(any(is_like(place, true) for place in found))
    assert sum(hits) >= 3


def solar_cells(seed: int) -> np.ndarray:
    """(H, W) factors of brightness: patches of dark cells, whose edges the mesh does not have."""
    random = np.random.default_rng(seed)
    row, column = np.mgrid[: CAMERA.height_px, : CAMERA.width_px]
    angle = random.uniform(0, np.pi)
    along = np.cos(angle) * column + np.sin(angle) * row
    across = np.cos(angle) * row - np.sin(angle) * column
    is_cell = (np.abs(along / 10 % 1 - 0.5) < 0.35) & (np.abs(across / 10 % 1 - 0.5) < 0.35)
    patches = cv2.GaussianBlur(random.normal(size=row.shape), (0, 0), 12) > 0
    return np.where(is_cell & patches, 0.05, 1.0)


@pytest.mark.parametrize("seed", [18, 19])
def test_where_edges_are_those_of_cells_light_tells_which_of_many_poses_is_like_the_true_one(
    sides: Sides, seed: int
) -> None:
    """In these two of twenty cases the poses whose edges lie best are all wrong."""
    true, bright, coverage = case(seed)
    box_px = box_of(coverage > 0.5)
    crop = crop_of(bright * solar_cells(100 + seed), box_px)
    by_edges = sides.by_edges(crop, box_px, 1.0, always)
    assert not any(is_like(place, true) for place in first_apart(by_edges, crop, 5))
    by_light = by_light_in_windows(crop, box_px, by_edges[:600], always)
    assert any(is_like(place, true) for place in first_apart(by_light, crop, 14))


def test_what_resembles_an_image_is_found_both_ways_and_told_once(sides: Sides) -> None:
    bright, coverage = seen_at(HERE)
    picture = Picture(np.float32(bright), CAMERA, None, is_linear=True)
    box_px = box_of(coverage > 0.5)
    found = sides.resembling(picture, box_px, HERE.t_body_cam_m, 48.0, always)
    assert any(is_like(place, HERE) for place in found.by_light)
    assert any(is_like(place, HERE) for place in found.by_edges)
    for k, place in enumerate(found.by_edges):
        errors = [pose_errors(*place, *other) for other in found.by_edges[:k]]
        assert not any(e_t < 0.05 and e_q < np.radians(7) for e_t, e_q in errors)


def test_without_time_nothing_is_drawn() -> None:
    setting = RefinerSetting(CRAFT, CAMERA, refiners._renderer)
    studio = Studio(setting, RenderCompareOptions().renderer)
    bright, coverage = seen_at(HERE)
    picture = Picture(np.float32(bright), CAMERA, None, is_linear=True)
    sides, box_px = Sides(studio, CRAFT.radius_m), box_of(coverage > 0.5)
    turns = iter([True] * 24 + [False] * 9)
    found = sides.resembling(picture, box_px, HERE.t_body_cam_m, 48.0, lambda: next(turns))
    assert found == ([], [])
    assert studio.images == 2


def refined_from_another_side() -> Refinement:
    """What the refiner makes of a start 110° off; neither the light nor a nearer start is known."""
    bright, coverage = seen_at(HERE)
    image = np.rint(255 * np.clip(bright, 0, 1)).astype(np.uint8)
    turn = Rotation.from_rotvec(np.radians(110) * np.array([0.6, 0.0, 0.8])).as_matrix()
    start = PoseEstimate(
        turn @ HERE.R_cam_from_body,
        1.03 * HERE.t_body_cam_m,
        np.diag([1e-3] * 5 + [3e-2]),
        np.ones(8, bool),
        1.0,
        certainty=0.3,
    )
    choice = ComponentChoice(name="render-compare")
    with contextlib.closing(open_refiner(load_plugins().registry, choice, CRAFT, CAMERA)) as refiner:
        return refiner.refine(image, [start], None, box_of(coverage > 0.5))


def assert_is_found(made: Refinement) -> None:
    e_t, e_q = pose_errors(*HERE, made.pose.R_cam_from_body, made.pose.t_body_cam_m)
    assert made.is_better
    assert e_t < 0.01
    assert np.degrees(e_q) < 1


@needs_raster
@pytest.mark.slow
def test_a_pose_is_found_from_a_start_that_shows_another_side() -> None:
    assert_is_found(refined_from_another_side())


@needs_raster
@pytest.mark.slow
def test_a_pose_is_found_where_its_half_turn_alone_looks_as_the_image_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    half_turn = HERE.turned(R_about(np.array([0.0, 0.0, 1.0]), np.pi))
    monkeypatch.setattr(Sides, "resembling", lambda *_: Resembling([half_turn], []))
    assert_is_found(refined_from_another_side())
