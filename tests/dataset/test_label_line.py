"""A line of labels: the record says what the JSON says, and says the difference of null and not made."""

from __future__ import annotations

import json
import math
import pickle
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._errors import InputError
from posse_core._model.label_line import IN_EVERY_LINE, Keypoint, LabelLine, LabelNotMade, annotator_of

numbers = st.floats(allow_nan=False, allow_infinity=False)
fractions = st.floats(0, 1)
names = st.text(min_size=1, max_size=8)
counts = st.integers(0, 2**40)


def vectors(length: int) -> st.SearchStrategy[list[float]]:
    return st.lists(numbers, min_size=length, max_size=length)


keypoints = st.one_of(
    st.just([None, None, 0]), st.tuples(numbers, numbers, st.sampled_from([0, 1, 2])).map(list)
)
readings = st.builds(
    dict,
    t_s=numbers,
    q_sensor_from_body=vectors(4),
    t_body_sensor_m=vectors(3),
    v_body_sensor_m_s=vectors(3),
    omega_body_rad_s=vectors(3),
    omega_sensor_rad_s=vectors(3),
    files=st.lists(st.text(), max_size=3),
    labels=st.dictionaries(names, st.none() | numbers | st.text()),
)
EVERY = {
    "index": counts,
    "t_s": numbers,
    "epoch_utc": st.text(),
    "sequence": st.integers(-(2**40), 2**40),
    "spacecraft": st.text(),
    "sun_fraction_target": fractions,
    "sun_fraction_camera": fractions,
    "solar_flux_w_m2": st.floats(0, 1e6),
    "image": st.text(),
    "truth": st.none() | st.text(),
}
CHOSEN = {
    "box_visible_px": st.none() | st.lists(st.integers(-9, 9999), min_size=4, max_size=4),
    "box_whole_px": st.none() | vectors(4),
    "mask_rle": st.builds(
        lambda size, counts: {"size": size, "counts": counts},
        st.lists(counts, min_size=2, max_size=2),
        st.text(),
    ),
    "mask_area_px": counts,
    "fraction_visible": st.none() | fractions,
    "fraction_lit": st.none() | fractions,
    "part_area_px": st.dictionaries(names, counts, max_size=4),
    "keypoints": st.dictionaries(names, keypoints, max_size=4),
    "q_cam_from_body": vectors(4),
    "t_body_cam_m": vectors(3),
    "range_m": st.floats(5e-324, 1e9),
    "phase_angle_rad": st.floats(0, math.pi),
    "sun_direction_body": vectors(3),
    "v_body_cam_m_s": vectors(3),
    "omega_body_rad_s": vectors(3),
    "omega_camera_rad_s": vectors(3),
    "exposure_s": st.floats(1e-9, 1e3),
    "origin": st.tuples(st.text(), counts).map(list),
    "sensors": st.dictionaries(names, st.lists(readings, max_size=2)),
    "nearest": st.dictionaries(names, st.none() | numbers | st.text() | st.lists(numbers)),
}
ORDER = [
    *("index", "t_s", "epoch_utc", "sequence", "spacecraft", "sun_fraction_target"),
    *("sun_fraction_camera", "solar_flux_w_m2", "box_visible_px", "box_whole_px", "mask_rle"),
    *("mask_area_px", "fraction_visible", "fraction_lit", "part_area_px", "keypoints"),
    *("q_cam_from_body", "t_body_cam_m", "range_m", "phase_angle_rad", "sun_direction_body"),
    *("v_body_cam_m_s", "omega_body_rad_s", "omega_camera_rad_s", "exposure_s", "image", "truth"),
    *("origin", "sensors", "nearest"),
]
WHOLE = {
    "index": 0,
    "t_s": 0.0,
    "epoch_utc": "2022-01-31T02:02:27",
    "sequence": 0,
    "spacecraft": "aqua",
    "sun_fraction_target": 1.0,
    "sun_fraction_camera": 1.0,
    "solar_flux_w_m2": 1361.0,
    "image": "images/000000.png",
    "truth": None,
}
"""A line with nothing but what every line has."""
lines = st.fixed_dictionaries(EVERY, optional=CHOSEN)


def text_of(values: dict) -> bytes:
    ordered = {name: values[name] for name in ORDER if name in values}
    return json.dumps(ordered, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()


@given(lines)
def test_a_line_is_read_and_written_to_the_byte(values):
    record = LabelLine.from_json(text_of(values))
    assert record.to_json() == text_of(values)
    assert pickle.loads(pickle.dumps(record)) == record


@given(lines)
def test_null_and_not_made_are_two_things(values):
    record = LabelLine.from_json(text_of(values))
    for name in ORDER[:-1]:
        assert record.has(name) == (name in values)
        if name not in values:
            with pytest.raises(LabelNotMade, match=name):
                getattr(record, name)
        elif values[name] is None:
            assert getattr(record, name) is None
    assert record.extras.get("nearest") == values.get("nearest")


def test_what_was_not_made_names_the_frame_and_the_annotator():
    record = LabelLine(index=7, box_visible_px=None)
    assert record.box_visible_px is None
    with pytest.raises(InputError, match=r"frame 7 has no 'keypoints'; add 'keypoints' to the scenario"):
        _ = record.keypoints
    assert not hasattr(record, "range_m")
    with pytest.raises(AttributeError, match="rnage_m"):
        _ = record.rnage_m
    with pytest.raises(ValueError, match="rnage_m"):
        record.has("rnage_m")


def test_a_keypoint_behind_the_camera_has_no_coordinates():
    record = LabelLine(index=0, keypoints={"A": [None, None, 0], "B": [1.5, 2.5, 2]})
    assert record.keypoints == {"A": Keypoint(None, None, 0), "B": Keypoint(1.5, 2.5, 2)}
    assert record.to_json() == b'{"index":0,"keypoints":{"A":[null,null,0],"B":[1.5,2.5,2]}}'


@pytest.mark.parametrize("text", ["Infinity", "-Infinity", "NaN", "1e999"])
@pytest.mark.parametrize(
    ("rest", "key"),
    [
        ('"nearest": {"A": [0.0, %s]}', "nearest.A.1"),
        ('"bodies": {"arm": {"nearest": {"A": %s}}}', "bodies.arm.nearest.A"),
        ('"sensors": {"twin": [%s]}', "sensors.twin.0.labels.sun.x"),
    ],
)
def test_numbers_of_plugins_and_sensors_are_finite(text, rest, key):
    if "twin" in rest:
        still = {"t_s": 0.0, "q_sensor_from_body": [1.0, 0.0, 0.0, 0.0], "labels": {"sun": {"x": -1.5}}}
        moving = ("t_body_sensor_m", "v_body_sensor_m_s", "omega_body_rad_s", "omega_sensor_rad_s")
        reading = json.dumps({**still, **{name: [0.0, 0.0, 0.0] for name in moving}})
        rest %= reading.replace("-1.5", "%s")
    line = text_of(WHOLE).decode()[:-1] + ", " + rest + "}"
    assert LabelLine.from_json((line % "-1.5").encode()).index == 0
    with pytest.raises(InputError, match=f"^{re.escape(key)}: input should be a finite number$"):
        LabelLine.from_json((line % text).encode())


@pytest.mark.parametrize("name", IN_EVERY_LINE)
def test_a_line_without_what_every_line_has_is_refused(name):
    values = {key: value for key, value in WHOLE.items() if key != name}
    with pytest.raises(InputError, match=f"{name}: field required"):
        LabelLine.from_json(text_of(values))


def test_every_label_of_an_annotator_is_documented_as_its():
    made = {name: annotator_of(name) for name in LabelLine.model_fields}
    assert {name for name, annotator in made.items() if annotator is None} == {
        *IN_EVERY_LINE,
        "bodies",
        "exposure_s",
        "finishes",
        "origin",
        "sensors",
    }
