"""Records of a crosscheck: how frames are summed up, and what a program reads of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posse_core._evaluation.crosscheck.measures import FrameMeasures, Pair, PairFrame, RendererFrame
from posse_core._evaluation.crosscheck.pictures import FramePictures
from posse_core._evaluation.crosscheck.summary import (
    Sums,
    material_ratios,
    pair_summary,
    part_ratios,
    renderer_summary,
)
from posse_core._model.spacecraft import Material
from posse_core.testing import scenes

FRAME = RendererFrame(
    iou=0.99,
    iou_centres=0.98,
    edge_px=0.1,
    shift_right_px=0.25,
    shift_down_px=0.0,
    growth_px=0.5,
    mean_radiance_w_m2_sr=10.0,
    seconds=9.0,
    opening_s=2.0,
)
PAIR = Pair("one", "other")


def test_a_renderers_frames_are_summed_up() -> None:
    second = replace(
        FRAME,
        iou=0.5,
        iou_centres=0.96,
        edge_px=0.3,
        shift_down_px=-0.75,
        growth_px=-0.25,
        seconds=1.0,
        opening_s=None,
        expected_ratio=1.02,
        noise=0.25,
    )
    third = replace(second, seconds=3.0, expected_ratio=0.95, noise=0.75)
    whole = renderer_summary([FRAME, second, third], Sums(30, 40, 6.0, 24.0))
    assert (whole.frames, whole.iou, whole.iou_worst) == (3, 0.75, 0.5)
    assert (whole.edge_px, whole.edge_worst_px) == (0.25, 0.3)
    assert whole.shift_worst_px == 0.75
    assert whole.growth_px == 0.0
    assert whole.iou_centres == pytest.approx((0.98 + 2 * 0.96) / 3)
    assert whole.expected_ratio == 0.95
    assert whole.noise == 0.5
    assert whole.landmark_worst_px is None
    assert whole.depth_median_m is None
    assert (whole.opening_s, whole.first_frame_s, whole.frame_s) == (2.0, 9.0, 2.0)
    assert renderer_summary([FRAME], Sums(1, 1, 0.0, 0.0)).frame_s == 9.0


def measures(ratio: float | None, one: list[float], other: list[float]) -> FrameMeasures:
    light = {"one": np.array(one), "other": np.array(other)}
    pair = PairFrame(iou=0.5, edge_px=0.25, radiance_ratio=ratio, ssim=ratio or 0.0)
    return FrameMeasures(
        3, 20.0, 0.5, {"one": FRAME, "other": FRAME}, {PAIR: pair}, light, FramePictures((), ())
    )


def test_a_pairs_light_is_summed_up_by_part_and_material() -> None:
    parts = [
        scenes.rectangle(name, material, u_m=(1, 0, 0), v_m=(0, 1, 0))
        for name, material in (("a", "red"), ("b", "blue"), ("c", "red"), ("d", "black"))
    ]
    colours = [Material(name) for name in ("red", "blue", "black", "unused")]
    scene = scenes.scene(*parts, materials=tuple(colours), camera=scenes.camera())
    frames = [
        measures(0.5, [1, 2, 3, 0], [2, 4, 6, 1]),
        measures(None, [1, 2, 1, 0], [0, 0, 0, 0]),
        measures(0.75, [0, 2, 2, 0], [0, 2, 2, 1]),
    ]
    assert part_ratios(PAIR, frames, scene) == {"a": 1.0, "b": 1.0, "c": 0.75, "d": None}
    assert material_ratios(PAIR, frames, scene) == {"red": 0.8, "blue": 1.0, "black": None}
    whole = pair_summary(PAIR, frames)
    assert whole.radiance_ratio == pytest.approx(14 / 18)
    assert (whole.radiance_ratio_least, whole.radiance_ratio_most) == (0.5, 0.75)
    assert (whole.iou, whole.edge_px, whole.ssim_worst) == (0.5, 0.25, 0.0)
    assert pair_summary(PAIR, frames[1:2]).radiance_ratio_least is None


def test_a_program_reads_what_was_measured() -> None:
    said = measures(None, [1.0], [1.0]).as_json()
    assert said["pairs"] == {
        "one / other": {"iou": 0.5, "edge_px": 0.25, "radiance_ratio": None, "ssim": 0}
    }
    always = {
        "iou": 0.99,
        "iou_centres": 0.98,
        "edge_px": 0.1,
        "shift_right_px": 0.25,
        "shift_down_px": 0.0,
        "growth_px": 0.5,
        "mean_radiance_w_m2_sr": 10.0,
        "seconds": 9.0,
    }
    assert said["renderers"]["one"] == always | {"opening_s": 2.0}
    later = replace(FRAME, opening_s=None, noise=0.0)
    assert later.as_json() == always | {"opening_s": None, "noise": 0.0}
