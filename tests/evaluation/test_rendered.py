"""``posse validate --render``: what was not rendered by the dataset's scenario is found."""

import copy
import shutil

import cv2
import numpy as np
import planting as p
import pytest

import posse_core as posse
from posse_core._dataset.dataset import Dataset
from posse_core._evaluation.rendered import check_rendered
from posse_core._model.srgb import linear_from_srgb, srgb_from_linear

pytest.importorskip("posse_render_raster", reason="the raster plugin is not installed")

COUNT = 2
SCENARIO = {
    "camera": {"width_px": 160, "height_px": 120, "hfov_deg": 50},
    "times": {"t_s": [3750.0, 3950.0]},
    "annotators": ["box", "mask", "keypoints", "pose"],
    "writers": [],
}


def brighter(factor):
    """The picture as if light were so much more."""

    def alter(image):
        return np.round(srgb_from_linear(factor * linear_from_srgb(image / 255)) * 255).clip(0, 255)

    return lambda image: alter(image).astype(np.uint8)


def brighter_target(folder):
    """Only the target, as by a renderer with other materials."""
    mask = Dataset(folder).mask(1)
    p.picture(1, lambda x: np.where(mask[..., None], brighter(1.05)(x), x))(folder)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rendered") / "d"
    posse.run("aqua", folder, renderer="raster", overrides=copy.deepcopy(SCENARIO))
    return folder


@pytest.fixture
def folder(made, tmp_path):
    shutil.copytree(made, tmp_path / "d")
    return tmp_path / "d"


def found(folder):
    result = check_rendered(Dataset(folder), COUNT, lambda places, frames: places)
    assert result.checked == COUNT
    return [(fault.frame, fault.message) for fault in result.faults]


def test_a_sound_dataset_comes_out_again(made):
    assert found(made) == []


def test_noise_of_another_machine_is_no_fault(folder):
    """A step of the picture to either side, in one of ten pixels."""
    draw = np.random.default_rng(0)
    noise = draw.choice([-1, 0, 1], (120, 160, 3), p=[0.05, 0.9, 0.05])
    p.picture(1, lambda x: (x + noise).clip(0, 255).astype(np.uint8))(folder)
    assert found(folder) == []


@pytest.mark.parametrize(
    ("plant", "words"),
    [
        (p.picture(1, brighter(1.1)), "the picture"),
        (p.picture(1, brighter(0.9)), "the picture"),
        (p.picture(1, brighter(2.0)), "differs by"),
        (brighter_target, "times as bright as rendered anew"),
        (p.picture(1, np.zeros_like), "differs by 100.0%"),
        (p.other_picture(1, 0), "differs by"),
        (p.picture(1, lambda x: x[:, ::-1]), "differs by"),
        (p.picture(1, lambda x: cv2.GaussianBlur(x, (0, 0), 4)), "differs by"),
        (p.picture(1, lambda x: x[..., ::-1]), "the picture"),
        (p.picture(1, lambda x: x[..., 0]), "rendered anew uint8 (120, 160, 3)"),
        (p.line(1, exposure_s=0.004), "exposure_s is 0.004, and rendered anew 0.002"),
        (p.line(1, fraction_lit=lambda x: x + 0.01), "fraction_lit is not"),
        (p.line(1, v_body_cam_m_s=lambda x: [-y for y in x]), "v_body_cam_m_s is not"),
    ],
)
def test_what_the_scenario_does_not_render_is_found(folder, plant, words):
    plant(folder)
    faults = found(folder)
    assert faults
    assert {frame for frame, _ in faults} == {1}
    assert words in faults[0][1]


def test_another_scenario_renders_other_pictures(folder):
    p.data("scenario.yaml", lambda x: x["sensor"].update(exposure_s=0.0022))(folder)
    assert {frame for frame, _ in found(folder)} == {0, 1}
