"""The core's own refiner, held to what a third party's is; and that the kit finds faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from posse_core import FloatArray, NoOptions, PoseEstimate, Refinement, Refiner, RefinerSetting
from posse_core._arrays import AnyArray
from posse_core._plugins.loading import load_plugins
from posse_core.testing import RefinerConformance, refiners


class TestRenderCompare(RefinerConformance):
    def refiner(self) -> Refiner:
        registry = load_plugins().registry
        # Drawings half as large as by default take a quarter of the time.
        options = registry.options("refiner", "render-compare", {"size_px": 96})
        made: Refiner = registry.create("refiner", "render-compare", options)
        return made


def test_all_are_here() -> None:
    assert load_plugins().registry.names("refiner") == ["render-compare"]


class Spoiled(Refiner):
    """Knows the truth by heart, and has one thing wrong with it."""

    def __init__(self, wrong: str) -> None:
        super().__init__(NoOptions())
        self.wrong, self.calls, self.is_open = wrong, 0, False

    def open(self, setting: RefinerSetting) -> None:
        self.is_open = True

    def refine(
        self,
        image: AnyArray,
        starts: Sequence[PoseEstimate],
        sun_direction_cam: FloatArray | None = None,
        box_px: FloatArray | None = None,
    ) -> Refinement:
        self.calls += 1
        wrong = self.wrong
        start = max(starts, key=lambda s: -abs(np.trace(s.R_cam_from_body.T @ refiners._R_TRUE) - 3))
        if wrong == "the first start":
            start = starts[0]
        if wrong == "needs the Sun":
            assert sun_direction_cam is not None
        if wrong == "needs no box":
            assert box_px is None
        if wrong == "changes the box" and box_px is not None:
            box_px += 1
        if wrong == "changes the image":
            image[:] = 0
        if wrong == "changes the start":
            start.t_body_cam_m[2] += 1e-9
        if wrong == "grey alone":
            assert image.ndim == 2
        is_seen = np.ptp(image.astype(np.float64)) > 90 and abs(start.t_body_cam_m[0]) < 10
        if wrong == "accepts everything":
            is_seen = True
        if not is_seen or wrong == "accepts nothing":
            copied = replace(start) if wrong == "a copy of the start" else start
            return Refinement(copied, False, 0.1, 0.1)
        shift_m = np.array([0.0, 0.0, 1e-3])
        if wrong == "remembers":
            shift_m *= self.calls
        if wrong == "blind":
            shift_m = start.t_body_cam_m - refiners._T_TRUE_M
        sigmas = np.full(6, 1e-5 if wrong == "too sure" else 5.0 if wrong == "knows nothing" else 1e-3)
        pose = replace(
            start,
            R_cam_from_body=start.R_cam_from_body
            if wrong == "the first start"
            else refiners._R_TRUE.copy(),
            t_body_cam_m=refiners._T_TRUE_M + shift_m,
            covariance=np.diag(sigmas**2),
        )
        return Refinement(pose, True, 0.9, 0.5)

    def close(self) -> None:
        if self.wrong == "closes once":
            assert self.is_open
        self.is_open = False


def kit(wrong: str) -> RefinerConformance:
    class Case(RefinerConformance):
        def refiner(self) -> Refiner:
            return Spoiled(wrong)

    return Case()


TESTS = [name for name in vars(RefinerConformance) if name.startswith("test_")]


@pytest.mark.parametrize("test", TESTS)
def test_one_that_knows_the_truth_passes(test: str) -> None:
    getattr(kit("nothing"), test)()


@pytest.mark.parametrize(
    ("wrong", "test"),
    [
        ("accepts nothing", "test_a_start_nearby_is_brought_closer"),
        ("blind", "test_a_start_nearby_is_brought_closer"),
        ("too sure", "test_the_error_is_as_small_as_the_covariance_says"),
        ("knows nothing", "test_the_error_is_as_small_as_the_covariance_says"),
        ("accepts everything", "test_where_nothing_is_seen_the_start_is_returned"),
        ("accepts everything", "test_a_start_out_of_view_is_returned"),
        ("a copy of the start", "test_where_nothing_is_seen_the_start_is_returned"),
        ("the first start", "test_of_several_starts_the_right_one_is_taken"),
        ("needs the Sun", "test_the_sun_need_not_be_known"),
        ("needs no box", "test_the_detected_box_may_be_known"),
        ("changes the box", "test_the_detected_box_may_be_known"),
        ("accepts nothing", "test_the_detected_box_may_be_known"),
        ("remembers", "test_the_same_image_gives_the_same_bits"),
        ("changes the image", "test_what_it_is_given_is_left_alone"),
        ("changes the start", "test_what_it_is_given_is_left_alone"),
        ("grey alone", "test_images_may_be_of_colour_and_of_16_bits"),
        ("closes once", "test_it_may_be_closed_twice_and_without_open"),
    ],
)
def test_a_wrong_refiner_fails(wrong: str, test: str) -> None:
    with pytest.raises(AssertionError):
        getattr(kit(wrong), test)()
