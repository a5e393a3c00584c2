"""What a component must not return is refused in one line that names the component and what is wrong.

The components are those of tests/packages/faulty, as an outside author would have written them.
"""

from __future__ import annotations

import importlib.util
import json
import math
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_run import BOX_OBJ, SCENARIO

from posse_core import (
    Camera,
    ComponentError,
    Detection,
    Detector,
    KeypointFinder,
    KeypointPlaces,
    Labels,
    NoOptions,
    PixelBox,
    Radiance,
    RenderRequest,
    View,
)
from posse_core._plugins.loading import Plugins
from posse_core._run.plan import make_plan
from posse_core._scenario.load import load_scenario
from posse_core._simulator.returned import checked_labels, checked_radiance, full_size, written
from posse_core._simulator.returned_detections import CheckedDetector, CheckedKeypointFinder
from posse_core.testing import scenes

PACKAGES = Path(__file__).parents[1] / "packages"
CAMERA = Camera(16, 12, 20.0, 20.0, 7.5, 5.5, 0.02)
BOX = PixelBox(3, 2, 5, 4)


@pytest.fixture(scope="module")
def view() -> View:
    part_id = np.full((BOX.height, BOX.width), -1, np.int16)
    part_id[1:3, 1:4] = 0
    shape = part_id.shape
    return View(
        box=BOX,
        part_id=part_id,
        triangle=part_id.astype(np.int32),
        depth_m=np.ones(shape, np.float32),
        normal_cam=np.ones((*shape, 3), np.float32),
        lit=np.ones(shape, bool),
        silhouette_px=6,
        keypoints_px=np.zeros((0, 2)),
        keypoints_visibility=np.zeros(0, np.int8),
        whole_box_px=np.zeros(4),
        target_parts=1,
    )


@pytest.mark.parametrize(
    ("dtype", "fill"),
    [(bool, False), (np.uint8, 0), (np.uint16, 0), (np.int8, -1), (np.int64, -1), (np.float16, np.nan)],
)
@pytest.mark.parametrize("axes", [(), (3,)])
def test_an_annotators_array_is_filled_by_its_type(view: View, dtype, fill, axes) -> None:
    inside = np.ones((BOX.height, BOX.width, *axes), dtype=dtype)
    labels = checked_labels(Labels(arrays={"extra": inside}), "mine", view)
    full = full_size(labels.arrays["extra"], view, CAMERA)
    assert full.shape == (12, 16, *axes)
    assert full.dtype == dtype
    expected = np.full((12, 16, *axes), fill, dtype=dtype)
    expected[2:6, 3:8] = 1
    np.testing.assert_array_equal(full, expected)


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (
            np.zeros((4, 4)),
            "is float64 of shape (4, 4); its first two sides must be the view's box, (4, 5)",
        ),
        (np.zeros((12, 16)), "(12, 16)"),
        (np.zeros(4), "shape (4,)"),
        (np.zeros((4, 5), complex), "is complex128 of shape (4, 5); it must be of floats, integers"),
        (np.zeros((4, 5), object), "object"),
        (np.zeros((4, 5), "M8[s]"), "datetime64"),
        ([[0.0] * 5] * 4, "type list, and must be a NumPy array"),
    ],
)
def test_another_array_is_refused(view: View, array, words: str) -> None:
    with pytest.raises(ComponentError) as error:
        checked_labels(Labels(arrays={"extra": array}), "mine", view)
    assert str(error.value).startswith("annotator 'mine': the array 'extra' ")
    assert words in str(error.value)


def test_an_arrays_name_stays_in_its_file(view: View) -> None:
    for name in ("../up", "a/b", "", 3):
        with pytest.raises(ComponentError, match=r"annotator 'mine': .* cannot be an array's name"):
            checked_labels(Labels(arrays={name: np.zeros((4, 5))}), "mine", view)


def test_values_become_plain_json(view: View) -> None:
    values = {
        "single": np.float32(0.5),
        "whole": np.int64(3),
        "yes": np.True_,
        "vector": np.arange(3, dtype=np.uint8),
        "pairs": ((1, np.float64(2.5)), [None, "x"]),
        "nested": {"deep": {"array": np.eye(2)}},
    }
    made = checked_labels(Labels(values), "mine", view).values
    assert json.loads(json.dumps(made)) == made
    assert made == {
        "single": 0.5,
        "whole": 3,
        "yes": True,
        "vector": [0, 1, 2],
        "pairs": [[1, 2.5], [None, "x"]],
        "nested": {"deep": {"array": [[1.0, 0.0], [0.0, 1.0]]}},
    }
    assert made["yes"] is True


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.float32("nan"), "the label 'key' is nan; give None"),
        ({"x": [0.0, np.inf]}, "the label 'key.x.1' is inf"),
        (np.array([1.0, np.nan]), "the label 'key.1' is nan"),
        ({1, 2}, "the label 'key' is a value of type set, which JSON does not have"),
        (object(), "type object"),
        (b"bytes", "type bytes"),
        (np.array([1j]), "type ndarray"),
        ({1: "x"}, "1 cannot be a label's key"),
    ],
)
def test_what_json_does_not_have_is_refused(view: View, value, words: str) -> None:
    with pytest.raises(ComponentError) as error:
        checked_labels(Labels({"key": value}), "mine", view)
    assert str(error.value).startswith("annotator 'mine': ")
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_an_annotator_must_return_labels(view: View) -> None:
    for made in (None, {"key": 1}):
        with pytest.raises(ComponentError, match=r"annotator 'mine' returned .* must return Labels"):
            checked_labels(made, "mine", view)


def radiance(**changes) -> Radiance:
    shape = (BOX.height, BOX.width)
    light = np.ones((*shape, 3), np.float32)
    return replace(Radiance(BOX, light, np.ones(shape, np.float32)), **changes)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (None, "returned None, and must return Radiance"),
        (radiance(box=PixelBox(0, 0, 5, 4)), "returned the box"),
        (
            radiance(radiance_rgb=np.ones((4, 5, 4), np.float32)),
            "radiance_rgb is float32 of shape (4, 5, 4)",
        ),
        (radiance(radiance_rgb=np.ones((4, 5, 3))), "must be float32 of shape (4, 5, 3)"),
        (radiance(radiance_rgb=[1.0]), "radiance_rgb is list"),
        (radiance(radiance_rgb=np.full((4, 5, 3), np.nan, np.float32)), "negative or not finite"),
        (radiance(radiance_rgb=np.full((4, 5, 3), np.inf, np.float32)), "negative or not finite"),
        (radiance(radiance_rgb=np.full((4, 5, 3), -1, np.float32)), "negative or not finite"),
        (radiance(coverage=np.ones((5, 4), np.float32)), "coverage is float32 of shape (5, 4)"),
        (radiance(coverage=np.full((4, 5), 1.1, np.float32)), "coverage has numbers outside of 0 … 1"),
        (radiance(coverage=np.full((4, 5), np.nan, np.float32)), "coverage has numbers outside"),
        (radiance(depth_m=np.ones((4, 5))), "depth_m is float64"),
    ],
)
def test_wrong_radiance_is_refused(made, words: str) -> None:
    state = scenes.frame(t_body_cam_m=(0, 0, 5), sun_direction_body=(0, 0, 1))
    request = RenderRequest(state.craft, BOX, None, 0)
    sound = radiance(depth_m=np.full((4, 5), np.nan, np.float32))
    assert checked_radiance(sound, request, "lamp") is sound
    with pytest.raises(ComponentError) as error:
        checked_radiance(made, request, "lamp")
    assert str(error.value).startswith("renderer 'lamp'")
    assert words in str(error.value)


NUMBERS = st.lists(
    st.floats(-0.5, 2, width=32) | st.sampled_from([-0.0, 5e-39, 1.0, 3e38, -3e38, math.inf, math.nan]),
    min_size=4,
    max_size=4,
)


@given(rgb=NUMBERS, coverage=NUMBERS, order=st.sampled_from(["<f4", ">f4"]))
def test_every_number_of_a_radiance_counts(rgb: list[float], coverage: list[float], order: str) -> None:
    """Wherever it stands, and whatever the order of its bytes."""
    state = scenes.frame(t_body_cam_m=(0, 0, 5), sun_direction_body=(0, 0, 1))
    box = PixelBox(0, 0, 2, 2)
    light = np.ones((2, 2, 3), order)
    light[..., 1] = np.reshape(rgb, (2, 2))
    made = Radiance(box, light, np.reshape(coverage, (2, 2)).astype(order))
    request = RenderRequest(state.craft, box, None, 0)
    sound = all(math.isfinite(x) and x >= 0 for x in rgb)
    sound &= all(-1e-4 <= x <= 1 + 1e-4 for x in coverage)
    if sound:
        assert checked_radiance(made, request, "lamp") is made
    else:
        with pytest.raises(ComponentError, match=r"negative or not finite|outside of 0 … 1"):
            checked_radiance(made, request, "lamp")


class Fixed(Detector):
    classes = ("craft",)

    def __init__(self, made) -> None:
        super().__init__(NoOptions())
        self.made = made

    def load(self, path) -> None:
        pass

    def predict(self, images):
        return self.made


FOUND = Detection("craft", 0.9, np.array([0.0, 0.0, 4.0, 3.0]))
PLACES = KeypointPlaces(np.zeros((2, 3, 2)), np.ones((2, 3)), np.full((2, 3), 0.3))
PLACED = FOUND.with_places(PLACES)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (None, "returned None"),
        ([], "returned 0 lists for 1 images"),
        ([None], "returned None, and must return a list of detections"),
        ([[{"label": "craft"}]], "type dict, and must return Detection"),
        ([[replace(FOUND, label=0)]], "the label 0"),
        ([[replace(FOUND, score=1.5)]], "the score 1.5"),
        ([[replace(FOUND, score=np.nan)]], "the score nan"),
        ([[replace(FOUND, box_px=[0, 0, 4])]], "box_px is float64 of shape (3,)"),
        ([[replace(FOUND, box_px=[0, 0, 4, np.nan])]], "box_px has numbers that are not finite"),
        ([[replace(FOUND, box_px="all")]], "box_px is a value of type str"),
        ([[replace(FOUND, keypoints_px=np.zeros((2, 3)))]], "keypoints_px is"),
        (
            [[replace(FOUND, keypoints_px=np.zeros((2, 2)), keypoints_sigma_px=np.zeros(3))]],
            "keypoints_sigma_px is",
        ),
        ([[replace(FOUND, places=PLACES)]], "has places, but no keypoints_px"),
        ([[replace(PLACED, places=(1, 2))]], "type tuple, and must return KeypointPlaces"),
        (
            [[replace(PLACED, places=replace(PLACES, points_px=np.zeros((3, 3, 2))))]],
            "places.points_px is float64 of shape (3, 3, 2)",
        ),
        (
            [[replace(PLACED, places=replace(PLACES, share=np.zeros((2, 2))))]],
            "places.share is float64 of shape (2, 2)",
        ),
        ([[replace(PLACED, places=replace(PLACES, share=np.full((2, 3), 0.4)))]], "more than 1"),
        ([[replace(PLACED, places=replace(PLACES, share=np.full((2, 3), -0.1)))]], "below 0"),
        ([[replace(PLACED, places=replace(PLACES, sigma_px=np.zeros((2, 3))))]], "deviations of 0"),
    ],
)
def test_wrong_detections_are_refused(made, words: str) -> None:
    image = np.zeros((8, 8), np.uint8)
    ((found,),) = CheckedDetector(Fixed([[replace(FOUND, box_px=[0, 0, 4, 3])]]), "net").predict([image])
    np.testing.assert_array_equal(found.box_px, FOUND.box_px)
    with pytest.raises(ComponentError) as error:
        CheckedDetector(Fixed(made), "net").predict([image])
    assert str(error.value).startswith("detector 'net'")
    assert words in str(error.value)


def test_wrong_keypoints_are_refused() -> None:
    class Finder(KeypointFinder):
        classes = ("craft",)
        made: object = None

        def __init__(self, options: NoOptions) -> None:
            super().__init__(options)
            self.keypoints_body_m = {"craft": np.zeros((2, 3))}

        def load(self, path) -> None:
            pass

        def find(self, image, detections):
            return self.made

    finder = Finder(NoOptions())
    checked = CheckedKeypointFinder(finder, "net")
    image = np.zeros((8, 8), np.uint8)
    finder.made = [replace(FOUND, keypoints_px=np.zeros((2, 2)))]
    assert len(checked.find(image, [FOUND])) == 1
    finder.made = [PLACED]
    assert checked.find(image, [FOUND])[0].places.share.sum() == pytest.approx(1.8)
    for made in ([], [FOUND], [replace(FOUND, keypoints_px=np.zeros((3, 2)))], None, "found"):
        finder.made = made
        with pytest.raises(ComponentError, match="detector 'net'"):
            checked.find(image, [FOUND])


@pytest.fixture(scope="module")
def plugins(faulty_path: Path, flat_renderer_path: Path):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(faulty_path)
        patch.syspath_prepend(flat_renderer_path)
        assert importlib.util.find_spec("posse_faulty")
        yield Plugins(
            [EntryPoint("faulty", "posse_faulty", "posse"), EntryPoint("flat", "posse_flat", "posse")]
        )


def plan(plugins: Plugins, folder: Path, **changes: object) -> None:
    (folder / "box.obj").write_text(BOX_OBJ)
    (folder / "small.yaml").write_text(SCENARIO)
    make_plan(load_scenario(str(folder / "small.yaml"), plugins.registry, changes), plugins.registry)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("none", "returned None, and must return Motion"),
        ("lists", "t_s is list, and must be a NumPy array"),
        ("short", "r_chaser_rtn_m is float64 of shape (7, 3), and must be floating of shape (8, 3)"),
        ("flat", "v_chaser_rtn_m_s is float64 of shape (8,)"),
        ("nan", "r_target_eci_m has numbers that are not finite"),
        ("times", "t_s differs from the requested times"),
        ("sequence", "sequence is float64 of shape (8,), and must be integer"),
        ("raises", "failed: ValueError: no luck"),
    ],
)
def test_a_propagators_fault_is_named(plugins: Plugins, tmp_path: Path, fault: str, words: str) -> None:
    plan(plugins, tmp_path, propagator={"name": "faulty"})
    with pytest.raises(ComponentError) as error:
        plan(plugins, tmp_path, propagator={"name": "faulty", "fault": fault})
    assert str(error.value).startswith("propagator 'faulty'")
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("none", "the attitude is NoneType, and must be a NumPy array"),
        ("lists", "the attitude is list, and must be a NumPy array"),
        ("one", "is float64 of shape (3, 3), and must be float64 of shape (8, 3, 3)"),
        ("single", "is float32 of shape (8, 3, 3), and must be float64 of shape (8, 3, 3)"),
        ("nan", "the attitude has numbers that are not finite"),
        ("mirrored", "the attitude at frame 2 is no rotation"),
        ("stretched", "the attitude at frame 1 is no rotation"),
        ("raises", "failed: ValueError: no luck"),
    ],
)
@pytest.mark.parametrize("subject", ["target", "camera"])
def test_an_attitude_laws_fault_is_named(
    plugins: Plugins, tmp_path: Path, subject: str, fault: str, words: str
) -> None:
    key = f"attitude.{subject}"
    plan(plugins, tmp_path, **{key: {"law": "faulty"}})
    with pytest.raises(ComponentError) as error:
        plan(plugins, tmp_path, **{key: {"law": "faulty", "fault": fault}})
    assert str(error.value).startswith("attitude-law 'faulty'")
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("none", "returned None, and must return Spacecraft"),
        ("name", "the name '../kite' cannot be a file's"),
        ("no parts", "no parts"),
        ("twice", "two parts have one name"),
        ("faces", "'sail': has no faces, or faces of other than its 3 vertices"),
        ("nan", "'sail': vertices_body_m has numbers that are not finite"),
        ("material", "'sail': there is no material 'foil'"),
        ("texture", "'foil': base_color_texture is uint8 of shape (4, 4)"),
        ("keypoint", "the keypoint 'S1' is float64 of shape (2,)"),
        ("skeleton", "the skeleton has ('S1', 'S9')"),
        ("raises", "failed: KeyError: 'no luck'"),
    ],
)
def test_a_scenes_fault_is_named(plugins: Plugins, tmp_path: Path, fault: str, words: str) -> None:
    plan(plugins, tmp_path, target={"name": "faulty"})
    with pytest.raises(ComponentError) as error:
        plan(plugins, tmp_path, target={"name": "faulty", "fault": fault})
    assert str(error.value).startswith("scene 'faulty'")
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("none", "returned None, and must return paths"),
        ("string", "returned a value of type str"),
        ("outside", "elsewhere.txt, which is not within"),
        ("absent", "absent.txt, which it has not written"),
        ("raises", "failed: RuntimeError: no luck"),
    ],
)
def test_a_writers_fault_is_named(plugins: Plugins, tmp_path: Path, fault: str, words: str) -> None:
    def write(fault: str) -> list[Path]:
        options = plugins.registry.options("writer", "faulty", {"fault": fault})
        writer = plugins.registry.create("writer", "faulty", options)
        return written(writer, "faulty", None, tmp_path)  # type: ignore[arg-type]  # it reads nothing

    assert write("") == [tmp_path / "ranges.txt", tmp_path / "extra"]
    with pytest.raises(ComponentError) as error:
        write(fault)
    assert str(error.value).startswith("writer 'faulty'")
    assert words in str(error.value)


@pytest.mark.parametrize("name", ["aqua", "cluster", "cubesat"])
def test_our_own_spacecraft_pass(plugins: Plugins, tmp_path: Path, name: str) -> None:
    plan(plugins, tmp_path, target={"name": name})
