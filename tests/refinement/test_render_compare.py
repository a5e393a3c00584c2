"""render-compare on small images that rays draw: it comes to the truth, and refuses what it does not
know."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posse_core import (
    Camera,
    CraftState,
    InputError,
    PixelBox,
    PoseEstimate,
    RenderRequest,
    Scene,
    Spacecraft,
)
from posse_core._evaluation.poses import pose_errors
from posse_core._interfaces.refiner import RefinerSetting
from posse_core._randomness import random_generator
from posse_core._refinement.compare import Comparison, LitComparer
from posse_core._refinement.crop import Picture, Scale
from posse_core._refinement.descent import Found, covariance
from posse_core._refinement.light import Light
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.render_compare import RenderCompare
from posse_core._refinement.studio import Lights, Studio
from posse_core.testing import refiners, scenes

CAMERA = scenes.camera(64, 48, np.radians(30))
NOISE_DN = 1.5
SUN = np.array([0.4, -0.5, -0.77]) / np.linalg.norm([0.4, -0.5, -0.77])


def image(
    R: np.ndarray,
    t: np.ndarray,
    seed: int,
    craft: Spacecraft | None = None,
    camera: Camera = CAMERA,
) -> np.ndarray:
    """(H, W) uint8, linear, with noise."""
    state = CraftState(
        R,
        t,
        sun_direction_cam=SUN,
        sun_irradiance_rgb_w_m2=np.full(3, np.pi),
        sun_angular_radius_rad=0.0047,
    )
    box = PixelBox(0, 0, camera.width_px, camera.height_px)
    light = refiners._renderer("", {}, Scene(craft or refiners._craft(), camera)).render(
        RenderRequest(state, box, None, 0)
    )
    dn = 220 * light.radiance_rgb.mean(axis=-1) + 6
    noise = random_generator(seed, 0, "noise").normal(0, NOISE_DN, dn.shape)
    return np.clip(np.rint(dn + noise), 0, 255).astype(np.uint8)


def start(R: np.ndarray, t: np.ndarray, degrees: float, share: float, seed: int) -> PoseEstimate:
    draw = random_generator(seed, 0, "start")
    axis = draw.standard_normal(3)
    turn = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix()
    shift = np.array([*(0.02 * draw.standard_normal(2)), share * t[2] * draw.choice([-1, 1])])
    return PoseEstimate(turn @ R, t + shift, np.eye(6) * 1e-3, np.ones(8, bool), 1.0)


def opened(camera: Camera = CAMERA, size_px: int = 96, **options: Any) -> RenderCompare:
    """A refiner; by default its drawings are half as large as of a refiner that is not told, and take a
    quarter of the time."""
    refiner = RenderCompare(RenderCompareOptions(size_px=size_px, **options))
    refiner.open(RefinerSetting(refiners._craft(), camera, refiners._renderer))
    return refiner


def errors(R: np.ndarray, t: np.ndarray, pose: PoseEstimate) -> np.ndarray:
    """(6,) small rotation and shift from the estimate to the truth."""
    turn = Rotation.from_matrix(R @ pose.R_cam_from_body.T).as_rotvec()
    return np.concatenate([turn, t - pose.t_body_cam_m])


TRUTHS = [
    (Rotation.from_euler("xyz", angles, degrees=True).as_matrix(), np.array(t))
    for angles, t in (
        ((20, -35, 15), (0.1, -0.05, 5.0)),
        ((-30, 25, 100), (-0.2, 0.1, 5.5)),
        ((150, 40, -20), (0.0, 0.1, 4.6)),
    )
]


BAR = replace(
    refiners._craft(), parts=(refiners._cuboid("bar", (-1, -0.2, -0.1), (1, 0.2, 0.1), "white"),)
)
"""It looks alike in four attitudes."""


@pytest.mark.parametrize(("degrees", "share"), [(2, 0.01), (5, 0.02), (10, 0.04)])
def test_from_a_start_nearby_it_comes_to_the_truth(degrees: float, share: float) -> None:
    """Its rim is some 30 pixels from its middle, so 0.6° are 0.3 pixels towards the camera or away, and
    0.6 % of the range 0.2 pixels."""
    refiner = opened(size_px=192)
    for seed, (R, t) in enumerate(TRUTHS):
        made = refiner.refine(image(R, t, seed), [start(R, t, degrees, share, seed)], SUN)
        off = errors(R, t, made.pose)
        assert made.is_better
        assert np.degrees(np.linalg.norm(off[:3])) < 0.6
        assert np.linalg.norm(off[3:]) < 0.006 * t[2]


def test_the_pose_is_as_exact_as_the_image_where_rivals_are_compared_in_fewer_pixels() -> None:
    """The spacecraft is some 110 pixels wide, and rivals are compared where it has some 30 of them."""
    camera = scenes.camera(256, 192, np.radians(30))
    R, t = TRUTHS[2]
    given = start(R, t, 3, 0.01, 2)
    made = opened(camera, size_px=32).refine(image(R, t, 2, camera=camera), [given], SUN)
    off = errors(R, t, made.pose)
    assert np.linalg.norm(off[3:]) < 0.0012 * t[2]
    assert np.degrees(np.linalg.norm(off[:3])) < 0.1


def test_from_a_start_far_away_it_walks_to_the_truth() -> None:
    """Farther than one descent reaches."""
    refiner = opened()
    for seed, (R, t) in enumerate(TRUTHS):
        made = refiner.refine(image(R, t, seed), [start(R, t, 30, 0.2, seed)], SUN)
        off = errors(R, t, made.pose)
        assert made.is_better
        assert np.degrees(np.linalg.norm(off[:3])) < 1
        assert np.linalg.norm(off[3:]) < 0.01 * t[2]


def test_another_spacecraft_is_refused() -> None:
    """A box and a wing that are not where the refiner's spacecraft has them."""
    R, t = TRUTHS[0]
    others = (
        replace(
            refiners._craft(), parts=(refiners._cuboid("a", (-1, -0.1, -0.1), (1, 0.1, 0.1), "white"),)
        ),
        replace(
            refiners._craft(), parts=(refiners._cuboid("b", (-0.2, -1, -0.5), (0.2, 1, 0.5), "cells"),)
        ),
    )
    refiner = opened()
    for other in others:
        given = start(R, t, 3, 0.01, 0)
        made = refiner.refine(image(R, t, 0, other), [given], SUN)
        assert not made.is_better
        assert made.pose is given


def test_without_a_known_sun_the_light_is_found() -> None:
    R, t = TRUTHS[0]
    made = opened().refine(image(R, t, 0), [start(R, t, 4, 0.02, 1)])
    assert made.is_better
    off = errors(R, t, made.pose)
    assert np.degrees(np.linalg.norm(off[:3])) < 0.7
    assert np.linalg.norm(off[3:]) < 0.01 * t[2]


def test_a_pose_with_which_the_image_agrees_is_certain_whatever_its_start() -> None:
    """And one with which it agrees less, through blur and noise, is less so."""
    R, t = TRUTHS[0]
    given = replace(start(R, t, 4, 0.02, 1), certainty=0.05)
    sharp = image(R, t, 0)
    noise = random_generator(1, 0, "more").normal(0, 20, sharp.shape)
    noisy = np.clip(np.rint(sharp + noise), 0, 255).astype(np.uint8)
    made = [opened().refine(each, [given], SUN) for each in (sharp, noisy)]
    assert all(each.is_better for each in made)
    assert made[0].agreement > made[1].agreement
    certainties = [each.pose.certainty for each in made]
    assert 1 > certainties[0] > 0.9 > certainties[1] > given.trust
    for each in made:
        assert each.pose.trust <= each.pose.certainty


def test_a_right_start_is_confirmed_and_one_that_is_off_is_not() -> None:
    for seed, (R, t) in enumerate(TRUTHS):
        seen = image(R, t, seed)
        found = opened().refine(seen, [start(R, t, 3, 0.01, seed)], SUN).pose
        again = opened().refine(seen, [found], SUN)
        assert not again.is_better
        assert again.certainty_left == 1
        assert again.pose is found
        none = opened().refine(np.zeros_like(seen), [found], SUN)
        assert none.certainty_left < 1
        hidden = opened().refine(seen, [start(R, t + np.array([9.0, 0.0, 0.0]), 3, 0.01, seed)], SUN)
        assert hidden.certainty_left < 1


def test_what_is_found_far_from_a_start_counts_against_it_also_where_it_is_not_accepted() -> None:
    """Of a bar that looks alike in four attitudes each is certain by a quarter to a half, and the start
    is 35° from the nearest one. What is found takes its place where the Sun is known: with that a right
    start would agree, so less than a third of its certainty is left. Where the Sun is not known, more is
    left than what is found has."""
    R, t = TRUTHS[0]
    refiner = RenderCompare(RenderCompareOptions(size_px=96))
    refiner.open(RefinerSetting(BAR, CAMERA, refiners._renderer))
    given = replace(start(R, t, 35, 0.01, 0), certainty=0.98, covariance=np.eye(6) * 1e-5)
    seen = image(R, t, 0, BAR)
    known = refiner.refine(seen, [given], SUN)
    assert known.is_better
    assert 0.25 < known.pose.certainty < 0.5
    assert np.linalg.norm(known.pose.t_body_cam_m - t) < 0.005 * np.linalg.norm(t)
    found, nothing = (refiner.refine(each, [given], None) for each in (seen, np.zeros_like(seen)))
    assert found.pose is nothing.pose is given
    assert 0.5 * 0.7 < found.certainty_left < 0.75 * 0.7
    assert nothing.certainty_left == pytest.approx(0.7, abs=0.01)


def test_agreement_with_a_trusted_start_makes_a_pose_as_certain_as_that() -> None:
    """Through so much noise that the image alone is no proof."""
    R, t = TRUTHS[0]
    noise = random_generator(1, 0, "more").normal(0, 20, image(R, t, 0).shape)
    noisy = np.clip(np.rint(image(R, t, 0) + noise), 0, 255).astype(np.uint8)
    near = replace(start(R, t, 4, 0.02, 1), covariance=np.eye(6) * 1e-5)
    made = [
        opened().refine(noisy, [replace(near, certainty=certainty)], SUN) for certainty in (0.05, 0.99)
    ]
    assert all(each.is_better for each in made)
    assert made[0].pose.certainty < 0.9
    assert made[1].pose.certainty == pytest.approx(0.99, abs=0.02)


def test_a_trusted_start_does_not_make_up_for_a_pose_that_looks_alike() -> None:
    """A bar looks alike in four attitudes."""
    R, t = TRUTHS[0]
    refiner = RenderCompare(RenderCompareOptions(size_px=96))
    refiner.open(RefinerSetting(BAR, CAMERA, refiners._renderer))
    near = replace(start(R, t, 4, 0.01, 0), certainty=0.99, covariance=np.eye(6) * 1e-5)
    made = refiner.refine(image(R, t, 0, BAR), [near], SUN)
    assert made.is_better
    assert 0.5 < made.pose.certainty < 0.95


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_start_turned_by_half_a_turn_is_put_right(axis: int) -> None:
    """Though the net is sure of it."""
    for seed, (R, t) in enumerate(TRUTHS):
        turned = R @ Rotation.from_rotvec(np.pi * np.eye(3)[axis]).as_matrix()
        made = opened().refine(image(R, t, seed), [start(turned, t, 3, 0.01, seed)], SUN)
        assert made.is_better
        assert np.degrees(np.linalg.norm(errors(R, t, made.pose)[:3])) < 1
        assert made.pose.certainty > 0.9


def test_of_a_bar_that_looks_alike_both_ways_neither_is_certain() -> None:
    """From a start that is not either, unless its symmetry is told, when they are one pose."""
    R, t = TRUTHS[0]
    turns = tuple(Rotation.from_rotvec(np.pi * axis).as_matrix() for axis in np.eye(3))
    seen, given = image(R, t, 0, BAR), replace(start(R, t, 3, 0.01, 0), certainty=0.4)
    certainties = []
    for symmetries in ((), turns):
        refiner = RenderCompare(RenderCompareOptions(size_px=96))
        refiner.open(RefinerSetting(replace(BAR, symmetries=symmetries), CAMERA, refiners._renderer))
        made = refiner.refine(seen, [given], SUN)
        assert made.is_better
        certainties.append(made.pose.certainty)
    assert certainties[0] < 0.7
    assert certainties[1] > 0.9


def ringed_bar(share: float) -> Spacecraft:
    """The bar with four rings about one half of it, which have this share of its brightness."""
    rings = [
        refiners._cuboid(f"ring_{k}", (x, -0.2, -0.102), (x + 0.05, 0.2, 0.102), "grey")
        for k, x in enumerate((0.2, 0.4, 0.6, 0.8))
    ]
    white = BAR.materials["white"]
    grey = replace(white, base_color=tuple(share * colour for colour in white.base_color))
    return replace(
        BAR,
        parts=(*BAR.parts, *rings),
        materials={"white": white, "grey": grey},
        symmetries=(np.diag([1.0, -1.0, -1.0]),),
    )


@pytest.mark.parametrize(
    ("share", "size_px", "camera", "certainty"),
    [(0.9, 192, CAMERA, 0.98), (0.95, 32, scenes.camera(160, 120, np.radians(30)), 0.9)],
    ids=["in the crop", "closer"],
)
@pytest.mark.parametrize("number", [0, 1, 2])
def test_faint_marks_tell_that_a_start_is_upside_down_though_the_net_is_sure(
    number: int, share: float, size_px: int, camera: Camera, certainty: float
) -> None:
    """They make the agreement hardly differ. Where the spacecraft has 32 pixels they are not seen, but
    the image shows it four times as large."""
    (R, t), craft = TRUTHS[number], ringed_bar(share)
    refiner = RenderCompare(RenderCompareOptions(size_px=size_px))
    refiner.open(RefinerSetting(craft, camera, refiners._renderer))
    turned = R @ Rotation.from_rotvec([0, 0, np.pi]).as_matrix()
    given = replace(start(turned, t, 2, 0.005, number), certainty=certainty)
    made = refiner.refine(image(R, t, number, craft, camera), [given], SUN)
    assert made.is_better
    pose = made.pose
    e_t, e_q = pose_errors(R, t, pose.R_cam_from_body, pose.t_body_cam_m, craft.symmetries)
    assert e_t < 0.005
    assert np.degrees(e_q) < 1


@pytest.mark.parametrize("number", [1, 2])
def test_outlines_alone_make_no_pose_more_certain_than_its_start(number: int) -> None:
    """A negative: dark where light of any direction is bright. From another side some light may explain
    most of it all the same, so brightness is to agree by more."""
    R, t = TRUTHS[number]
    given = replace(start(R, t, 2, 0.01, 1), certainty=0.3)
    made = opened(size_px=192, least_agreement=0.97).refine(255 - image(R, t, 0), [given])
    assert made.is_better
    assert np.degrees(np.linalg.norm(errors(R, t, made.pose)[:3])) < 5
    assert made.pose.certainty == pytest.approx(given.trust)
    assert made.pose.trust <= given.trust


def test_with_hardly_any_time_the_start_or_something_better_comes_back() -> None:
    R, t = TRUTHS[0]
    given = start(R, t, 5, 0.02, 0)
    made = opened(ms=1e-3).refine(image(R, t, 0), [given], SUN)
    before, after = errors(R, t, given), errors(R, t, made.pose)
    assert np.linalg.norm(after) <= np.linalg.norm(before)


def test_an_image_of_another_size_is_refused() -> None:
    R, t = TRUTHS[0]
    with pytest.raises(InputError, match="give the camera that took it"):
        opened().refine(np.zeros((10, 10), np.uint8), [start(R, t, 1, 0.01, 0)], SUN)
    with pytest.raises(InputError, match="no start pose"):
        opened().refine(image(R, t, 0), [], SUN)


def test_detail_tells_poses_that_look_alike_in_uneven_light() -> None:
    """A bar with a faint spot near one end, in light that falls off along it to four tenths: the spot
    drawn at the other end leaves more of what varies within a few pixels, in both places, whatever the
    light, and the lead of one pose is what the other is behind."""
    R, t = TRUTHS[0]
    parts = (
        *BAR.parts,
        refiners._cuboid("spot", (0.6, -0.2, -0.102), (0.7, 0.2, 0.102), "cells"),
    )
    marked = replace(refiners._craft(), parts=parts)
    here = Placement(R, t)
    there = here.turned(Rotation.from_rotvec([0, 0, np.pi]).as_matrix())
    vertices_m = np.concatenate([part.vertices_body_m for part in parts])
    with contextlib.closing(
        Studio(RefinerSetting(marked, CAMERA, refiners._renderer), RenderCompareOptions().renderer)
    ) as studio:
        leads = []
        for least in (1.0, 0.4):
            seen = image(R, t, 0, marked) * np.linspace(1.0, least, CAMERA.width_px) / 255
            crop = Picture(np.float32(seen), CAMERA, None, is_linear=True).crop(
                here, vertices_m, Scale(1, 1)
            )
            assert crop is not None
            comparer = LitComparer(crop, studio, Light(Lights(0.9, 0.0, SUN), 0.4))
            leads.append(comparer.lead(here, comparer, there))
            assert comparer.lead(there, comparer, here) == pytest.approx(-leads[-1])
            assert comparer.lead(here, comparer, here) == 0
    assert min(leads) > 0.5


def test_a_pose_of_which_the_image_leaves_a_direction_open_has_no_covariance():
    """Of five pixels no six unknowns follow; of a thousand they do, with an error of each."""
    random = np.random.default_rng(1)
    placement = Placement(np.eye(3), np.array([0.0, 0.0, 10.0]))

    def found(side: int) -> Found:
        residual = random.normal(size=(side, 5), scale=0.01).astype(np.float32)
        by_pose = random.normal(size=(side, 5, 6)).astype(np.float32)
        agree = Comparison(residual, by_pose, np.ones((side, 5), bool), 0.99)
        return Found(placement, agree, radius_px=100.0)

    assert covariance(found(1), 1.0) is None
    C = covariance(found(200), 1.0)
    assert C is not None
    assert np.linalg.eigvalsh(C).min() > 0


def test_no_pose_is_exact_however_little_is_left_of_the_disagreement():
    """Without any residual, the rim (100 px from the middle, 1 m) is known to a hundredth of a pixel and
    no better: turns to so much of a hundredth of a radian, shifts to so much of a centimetre, and the
    range, ten times the radius, ten times worse."""
    random = np.random.default_rng(2)
    by_pose = random.normal(size=(40, 40, 6)).astype(np.float32)
    agree = Comparison(np.zeros((40, 40), np.float32), by_pose, np.ones((40, 40), bool), 1.0)
    found = Found(Placement(np.eye(3), np.array([0.0, 0.0, 10.0])), agree, radius_px=100.0)
    C = covariance(found, radius_m=1.0)
    assert C is not None
    sigma_px = np.sqrt(np.diag(C)) / np.array([0.01, 0.01, 0.01, 0.01, 0.01, 0.1])
    assert sigma_px == pytest.approx(np.full(6, sigma_px[0]))
    assert 0.005 < sigma_px[0] < 0.02
