"""At the true pose image and drawing agree at each scale, whatever is thin, white or behind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import EnvironmentMap, Part, PoseEstimate
from posse_core._model.srgb import srgb_from_linear
from posse_core._randomness import random_generator
from posse_core._refinement.placement import Placement
from posse_core.testing import refiners
from posse_core.testing.closed_forms import directions
from tests.support.raycast_images import BUS, HERE, SUN, fits, light_of, opened, with_booms


def test_booms_that_are_thinner_than_a_coarse_pixel_are_drawn_whole() -> None:
    """A boom is half a pixel of the image wide, and an eighth of one of the coarsest scale."""
    craft = with_booms(0.0025, (0.1, 0.08, 0.1))
    for _, _, agreement in fits(craft, 0.9 * light_of(craft)[0]):
        assert agreement > 0.985


@pytest.mark.slow
def test_a_spacecraft_of_thin_booms_is_found_from_far_off() -> None:
    """They are a pixel wide, and their tips some 40 pixels from where they are at the start."""
    craft = with_booms(0.006, (0.25, 0.2, 0.2))
    image = np.rint(255 * np.clip(0.8 * light_of(craft)[0], 0, 1)).astype(np.uint8)
    draw = random_generator(1, 0, "start")
    axis = draw.standard_normal(3)
    turn = Rotation.from_rotvec(np.radians(30) * axis / np.linalg.norm(axis)).as_matrix()
    start = PoseEstimate(
        turn @ HERE.R_cam_from_body, 0.9 * HERE.t_body_cam_m, np.eye(6) * 1e-3, np.ones(8, bool), 1.0
    )
    refiner = opened(craft)
    made = refiner.refine(image, [start], SUN)
    refiner.close()
    assert made.is_better
    off = Rotation.from_matrix(HERE.R_cam_from_body @ made.pose.R_cam_from_body.T).magnitude()
    assert np.degrees(off) < 0.1
    np.testing.assert_allclose(made.pose.t_body_cam_m, HERE.t_body_cam_m, atol=0.01)


@pytest.mark.parametrize("slope", [0.3, -0.6])
def test_a_bright_edge_beside_and_behind_the_spacecraft_is_told_from_it(slope: float) -> None:
    """As the Earth's limb is, far brighter than the spacecraft."""
    craft = refiners._craft()
    bright, coverage = light_of(craft)
    v, u = np.indices(bright.shape)
    behind = np.where(v - 110 > slope * (u - 128), 0.8, 0.02)
    agreements = [agreement for *_, agreement in fits(craft, 0.25 * bright + (1 - coverage) * behind)]
    assert min(agreements) > 0.97
    assert agreements[-1] > 0.985


def test_pixels_that_are_white_in_part_say_nothing_of_the_light() -> None:
    """White stripes are overexposed, and narrower than a pixel of the coarsest scale."""
    stripes = [
        refiners._cuboid(f"stripe {k}", (x, -0.401, -0.351), (x + 0.02, 0.401, 0.351), "white")
        for k, x in enumerate(np.linspace(-0.48, 0.45, 10))
    ]
    craft = replace(refiners._craft(), parts=(BUS, *stripes))
    seen = np.clip(4.0 * light_of(craft)[0], 0, 1)
    assert (seen == 1).any()
    for _, light, _ in fits(craft, seen):
        assert light.lights.sun == pytest.approx(4.0, rel=0.1)


def test_how_an_image_is_coded_is_not_told_by_a_wrong_start() -> None:
    """At the attitude of this seed an image coded by sRGB agrees more if it is taken for linear."""
    craft = refiners._craft()
    linear = np.clip(0.8 * light_of(craft)[0] + 0.01, 0, 1)
    noise = random_generator(0, 0, "noise").normal(0, 0.004, linear.shape)
    seen = srgb_from_linear(np.float32(linear)) + noise
    image = np.clip(np.rint(255 * seen), 0, 255).astype(np.uint8)
    refiner = opened(craft)
    turn = Rotation.random(random_state=2).as_matrix()
    wrong, right = (
        PoseEstimate(each.R_cam_from_body, each.t_body_cam_m, np.eye(6) * 1e-3, np.ones(8, bool), 1.0)
        for each in (HERE.turned(turn), HERE.moved(np.array([0.05, 0.03, 0, 0.02, 0, 0.05])))
    )
    made = refiner.refine(image, [wrong, right], SUN)
    refiner.close()
    off = Rotation.from_matrix(made.pose.R_cam_from_body @ HERE.R_cam_from_body.T)
    assert made.is_better
    assert np.degrees(off.magnitude()) < 0.3
    assert made.agreement > 0.999


def test_a_spacecraft_lit_by_the_earth_on_one_side_agrees() -> None:
    """The Sun shines from beyond it, and a disc of 65 degrees about a direction in place of it."""
    sun = np.array([0.3, -0.2, 0.93]) / np.linalg.norm([0.3, -0.2, 0.93])
    side = np.array([-0.6, 0.8, 0.0])
    earth = np.where(directions(32) @ side > np.cos(np.radians(65)), 0.3, 0.0)
    sky = EnvironmentMap(np.repeat(earth[..., None], 3, axis=-1).astype(np.float32))
    craft = refiners._craft()
    for _, light, agreement in fits(craft, light_of(craft, sun=sun, sky=sky)[0], sun):
        assert agreement > 0.97
        assert side @ light.lights.sky_slope > 0.5


def test_of_two_sizes_that_of_the_detected_box_is_taken() -> None:
    """A small spacecraft beside the detected one is as its mesh says, which that one is not quite."""
    craft = refiners._craft()
    dirty = replace(craft, parts=(*craft.parts, *_patches()))
    far = Placement(HERE.R_cam_from_body, np.array([2.6, 1.4, 12.0]))
    near_light, near_cover = light_of(dirty)
    far_light, far_cover = light_of(craft, far)
    assert not (near_cover * far_cover).any()
    seen = srgb_from_linear(np.float32(np.clip(0.7 * (near_light + far_light), 0, 1)))
    image = np.rint(255 * seen).astype(np.uint8)
    starts = [
        PoseEstimate(each.R_cam_from_body, each.t_body_cam_m, np.eye(6) * 1e-3, np.ones(8, bool), 1.0)
        for each in (HERE, far)
    ]
    refiner = opened(craft)
    made = [refiner.refine(image, starts, SUN, box_of(cover)) for cover in (near_cover, far_cover)]
    refiner.close()
    ranges_m = [float(each.pose.t_body_cam_m[2]) for each in made]
    assert ranges_m == pytest.approx([5.2, 12.0], rel=0.03)


def box_of(coverage: np.ndarray) -> np.ndarray:
    """The box (4,) of what is covered."""
    rows, columns = (np.flatnonzero(np.any(coverage > 0, axis=axis)) for axis in (1, 0))
    low = np.array([columns[0], rows[0]])
    return np.concatenate([low, np.array([columns[-1], rows[-1]]) + 1 - low]).astype(np.float64)


def _patches() -> list[Part]:
    """White patches that no mesh has."""
    return [
        refiners._cuboid(f"patch {k}", (x, y, -0.36), (x + 0.2, y + 0.2, -0.349), "white")
        for k, (x, y) in enumerate([(-0.4, -0.3), (0.1, 0.0), (-0.1, -0.35)])
    ]
