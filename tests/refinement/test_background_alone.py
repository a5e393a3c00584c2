"""Whether there may be no spacecraft where a pose is: what the background alone explains there."""

from __future__ import annotations

import numpy as np
import pytest

from posse_core._interfaces.refiner import RefinerSetting
from posse_core._refinement.compare import LitComparer
from posse_core._refinement.crop import Picture, scales
from posse_core._refinement.light import Light
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.studio import Lights, Studio
from posse_core._refinement.trail import MATERIALS_UNKNOWN
from posse_core.testing import refiners
from tests.support.raycast_images import CAMERA, HERE, SUN, light_of

CRAFT = refiners._craft()


def agreement_of_background(seen: np.ndarray) -> float:
    """In an image (H, W), where the spacecraft is drawn at a pose."""
    studio = Studio(RefinerSetting(CRAFT, CAMERA, refiners._renderer), RenderCompareOptions().renderer)
    picture = Picture(np.float32(seen), CAMERA, None, is_linear=True)
    crop = picture.crop(HERE, studio.hull_m, scales(100.0, (48.0,))[0])
    assert crop is not None
    comparer = LitComparer(crop, studio, Light(Lights(0.8, 0.1, SUN), 0.0))
    return comparer.agreement_of_background(HERE)


def test_a_sky_that_grows_brighter_to_one_side_explains_itself() -> None:
    ramp = np.linspace(0.1, 0.7, CAMERA.width_px)[None].repeat(CAMERA.height_px, axis=0)
    assert agreement_of_background(ramp) > 0.95


def test_a_black_sky_explains_nothing_of_a_spacecraft() -> None:
    bright, _ = light_of(CRAFT)
    assert agreement_of_background(0.8 * bright) < 0.05


@pytest.mark.parametrize("agreement", [0.95, 0.97, 0.999])
def test_without_materials_what_agrees_by_more_than_most_true_poses_do_is_no_likelier(
    agreement: float,
) -> None:
    assert MATERIALS_UNKNOWN.chance(agreement, 0.5) == pytest.approx(0.5 / 8 / 0.05**4)
    assert MATERIALS_UNKNOWN.chance(0.9, 0.5) == pytest.approx(0.5 / 8 / 0.1**4)
