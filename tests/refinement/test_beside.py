"""Where materials are not known, a pose agrees less with an image that shows more than its drawing
covers."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._interfaces.refiner import RefinerSetting
from posse_core._model.spacecraft import PLAIN, Spacecraft
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Picture, Scale
from posse_core._refinement.light import Light
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.studio import Lights, Studio
from posse_core.testing import refiners
from tests.support.raycast_images import CAMERA, HERE, SUN, box_of, light_of

SKY = 0.1
CORNERS_M = 0.5 * np.array([[-1.0, -1, 0], [1, 1, 0]])


def plate(length_m: float) -> Spacecraft:
    """A plate that reaches so far to one side, of which no material is known."""
    part = refiners._cuboid("plate", (-0.4, -0.3, -0.02), (length_m, 0.3, 0.02), PLAIN.name)
    return Spacecraft("plate", (part,), {PLAIN.name: PLAIN})


def agreement(craft: Spacecraft, seen: np.ndarray, box_px: np.ndarray | None) -> float:
    vertices_m = np.concatenate([part.vertices_body_m for part in craft.parts])
    setting = RefinerSetting(craft, CAMERA, refiners._renderer)
    crop = Picture(np.float32(seen), CAMERA, box_px, is_linear=True).crop(HERE, vertices_m, Scale(1, 1))
    assert crop is not None
    with contextlib.closing(Studio(setting, RenderCompareOptions().renderer)) as studio:
        return LitComparer(crop, studio, Light(Lights(0.9, 0.0, SUN), 0.4)).compare(HERE).agreement


def test_a_drawing_of_half_of_what_is_seen_agrees_less() -> None:
    whole, half = plate(0.9), plate(0.25)
    seen = 0.8 * light_of(whole)[0]
    box_px = box_of(seen > 0.05)
    assert agreement(whole, seen, box_px) == pytest.approx(agreement(whole, seen, None), abs=1e-3)
    assert agreement(whole, seen, box_px) > 0.95
    assert agreement(half, seen, box_px) < 0.75 * agreement(half, seen, None)


@given(
    st.integers(5, 30),
    st.integers(5, 20),
    st.floats(0.3, 0.9),
    st.sampled_from([-1.0, -0.8, 0.0, 1.0]),
)
def test_what_stands_out_is_the_square_of_the_difference(
    width: int, height: int, bright: float, aside_m: float
) -> None:
    """A bright rectangle in the detected box, and another beyond it; and a crop that holds the box, a
    part of it, or is elsewhere."""
    seen = np.full((CAMERA.height_px, CAMERA.width_px), SKY, np.float32)
    seen[12 : 12 + height, 16 : 16 + width] = bright
    seen[-2:, -2:] = bright
    box_px = np.array([14.0, 10.0, width + 4, height + 4])
    picture = Picture(seen, CAMERA, box_px, is_linear=True)
    place = Placement(np.eye(3), HERE.t_body_cam_m + np.array([aside_m, 0, 0]))
    crop = picture.crop(place, CORNERS_M, Scale(1, 1))
    assert crop is not None
    total = float(crop.standing_out.sum()) + crop.standing_out_beyond
    assert total == pytest.approx(width * height * (bright - SKY) ** 2, rel=2e-3)
    box = crop.drawn_box
    inside = np.zeros_like(seen, np.bool_)
    inside[12 : 12 + height, 16 : 16 + width] = True
    np.testing.assert_allclose(
        crop.standing_out, inside[box.slices] * (bright - SKY) ** 2, rtol=2e-3, atol=1e-6
    )


def test_nothing_stands_out_before_a_sky_that_varies_as_much() -> None:
    random = np.random.default_rng(3)
    seen = random.uniform(0, 1, (CAMERA.height_px, CAMERA.width_px)).astype(np.float32)
    picture = Picture(seen, CAMERA, np.array([14.0, 10.0, 20, 20]), is_linear=True)
    crop = picture.crop(HERE, CORNERS_M, Scale(1, 1))
    assert crop is not None
    assert crop.standing_out.sum() + crop.standing_out_beyond == 0
