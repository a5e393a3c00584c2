"""What the page carries of sensors' readings, without a browser."""

import base64
import json
import re

import cuboid
import cuboid_sensors
import cv2
import numpy as np
import pytest

from posse_core._dataset.dataset import Dataset
from posse_core._model.reading import Reading
from posse_core._view.readings import MOST_EVENTS, MOST_POINTS, MOST_READINGS, reading_preview


def numbers(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def map_values(coded):
    """Values of a map on its box, NaN for none."""
    steps = cv2.imdecode(numbers(coded["png"], np.uint8), cv2.IMREAD_UNCHANGED)
    values = coded["low"] + (steps - 1.0) / 254 * (coded["high"] - coded["low"])
    return np.where(steps > 0, values, np.nan)


def block(page, name):
    return json.loads(re.search(rf'id="{name}">(.*?)</script>', page.read_text(), re.DOTALL)[1])


@pytest.fixture(scope="module")
def page(view, sensed, tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "page.html"
    result = view(sensed, "--out", out)
    assert result.exit_code == 0, result.output
    return out


def test_the_page_describes_the_sensors(page):
    sensors = block(page, "dataset")["sensors"]
    assert set(sensors) == {sensor.name for sensor in cuboid_sensors.SENSORS}
    assert sensors["scanner"] == {"type": "lidar", "rate_hz": 0.5, "camera": None}
    assert sensors["eye"]["camera"]["width_px"] == 80
    assert block(page, "dataset")["spacecraft"]["brick"]["parts"] == list(cuboid.SIDES)


def test_readings_have_their_labels(page, sensed):
    for line in cuboid.read_lines(sensed):
        shown = block(page, f"frame-{line['index']}")["labels"]["sensors"]
        del line["sensors"]["second"][0]["labels"]["part_area_px"]
        assert shown == line["sensors"]


def test_points_are_those_of_the_arrays(page, sensed):
    dataset = Dataset(sensed)
    for i in range(len(dataset)):
        coded = block(page, f"frame-{i}")["preview"]["readings"]["scanner"]
        for scan, reading in zip(coded, dataset.readings(i, "scanner"), strict=True):
            arrays, points = reading.arrays, scan["points"]
            found = np.isfinite(arrays["point_sensor_m"]).all(axis=1)
            assert points["total"] == found.sum() < MOST_POINTS
            xyz = numbers(points["xyz"], np.float32).reshape(-1, 3)
            np.testing.assert_allclose(xyz, arrays["point_sensor_m"][found], rtol=1e-6)
            assert np.array_equal(numbers(points["part"], np.int16), arrays["part_id"][found])
            intensity = points["intensity"]
            assert intensity["name"] == "intensity_e"
            steps = numbers(intensity["steps"], np.uint8) / 255
            decoded = intensity["low"] + steps * (intensity["high"] - intensity["low"])
            expected = np.log10(arrays["intensity_e"][found])
            np.testing.assert_allclose(
                decoded, expected, atol=np.ptp(expected) / 509 if found.any() else 0
            )
            assert scan["events"] is None
            assert scan["maps"] == {}


def test_events_are_those_of_the_arrays(page, sensed):
    dataset = Dataset(sensed)
    for i in range(len(dataset)):
        arrays = dataset.readings(i, "eye")[0].arrays
        coded = block(page, f"frame-{i}")["preview"]["readings"]["eye"][0]
        assert coded["points"] is None
        assert coded["size_px"] == [80, 60]
        events = coded["events"]
        assert events["total"] == len(arrays["x"])
        assert events["last_us"] == arrays["t_us"].max(initial=0)
        for name, dtype in {"x": np.uint16, "y": np.uint16, "t_us": np.float32}.items():
            assert np.array_equal(numbers(events[name], dtype), arrays[name])
        assert np.array_equal(numbers(events["on"], np.uint8), arrays["p"])


def test_temperatures_are_maps(page, sensed):
    dataset = Dataset(sensed)
    for i in range(len(dataset)):
        arrays = dataset.readings(i, "warmth")[0].arrays
        maps = block(page, f"frame-{i}")["preview"]["readings"]["warmth"][0]["maps"]
        there = [name for name in maps if np.isfinite(arrays[name]).any()]
        assert list(maps) == there
        for name in there:
            x, y, w, h = maps[name]["box"]
            values, low, high = arrays[name], maps[name]["low"], maps[name]["high"]
            assert (low, high) == (np.nanmin(values), np.nanmax(values))
            outside = values.copy()
            outside[y : y + h, x : x + w] = np.nan
            assert not np.isfinite(outside).any()
            crop = values[y : y + h, x : x + w]
            np.testing.assert_allclose(map_values(maps[name]), crop, atol=(high - low) / 507 + 1e-9)
    assert "brightness_temperature_k" in there


def test_the_image_is_carried(page, sensed):
    image = Dataset(sensed).readings(1, "second")[0].image
    jpeg = block(page, "frame-1")["preview"]["readings"]["second"][0]["image"]
    decoded = cv2.imdecode(numbers(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert np.abs(decoded.astype(float) - image).mean() < 6


def test_another_sensors_reading_is_listed(page):
    for index in range(6):
        reading = block(page, f"frame-{index}")["preview"]["readings"]["gauge"][0]
        assert reading == {
            "arrays": [
                ["x", "float64", [3]],
                ["t_us", "int64", [4]],
                ["spectrum", "float32", [2, 3, 4]],
            ],
            "files": {},
            "size_px": None,
            "image": None,
            "maps": {},
            "points": None,
            "events": None,
        }


def test_many_points_and_events_are_thinned_evenly():
    count = 50_000
    point_m = np.column_stack([np.arange(count), np.ones(count), np.ones(count)])
    point_m[::5] = np.nan
    points = reading_preview(Reading(arrays={"point_sensor_m": point_m}), None)["points"]
    x = numbers(points["xyz"], np.float32)[::3]
    assert (points["total"], len(x)) == (40_000, MOST_POINTS)
    assert (x[0], x[-1]) == (1, count - 1)
    assert np.diff(x).min() > 0
    assert np.diff(x).max() <= 14
    assert points["part"] is points["intensity"] is None

    times = np.arange(count)[::-1]
    columns = {"x": times % 64, "y": times % 32, "t_us": 20 * times, "p": np.where(times % 2, 1, -1)}
    preview = reading_preview(Reading(arrays=columns), None)
    events = preview["events"]
    t_us = numbers(events["t_us"], np.float32).astype(int)
    assert (events["total"], len(t_us)) == (count, MOST_EVENTS)
    assert (t_us[0], t_us[-1]) == (0, 20 * (count - 1))
    assert np.diff(t_us).min() > 0
    assert np.diff(t_us).max() <= 7 * 20
    assert np.array_equal(numbers(events["x"], np.uint16), t_us // 20 % 64)
    assert np.array_equal(numbers(events["on"], np.uint8), t_us // 20 % 2)
    assert preview["size_px"] == [64, 32]


def test_points_may_stand_in_rows_and_columns():
    point_m = np.arange(36.0).reshape(3, 4, 3)
    arrays = {
        "point_sensor_m": point_m,
        "part_id": np.arange(12).reshape(3, 4),
        "intensity": np.ones(12),
    }
    points = reading_preview(Reading(arrays=arrays), None)["points"]
    assert np.array_equal(numbers(points["xyz"], np.float32), np.arange(36))
    assert np.array_equal(numbers(points["part"], np.int16), np.arange(12))
    assert points["intensity"] is None


def test_maps_have_the_size_of_the_pixels():
    pixels = (cuboid_sensors.SMALL.height_px, cuboid_sensors.SMALL.width_px)
    arrays = {
        "depth_m": np.ones(pixels),
        "corner_m": np.ones((4, 3)),
        "part_id": np.ones(pixels, np.int16),
        "nothing_m": np.full(pixels, np.nan),
    }

    def maps(camera, **image):
        return set(reading_preview(Reading(arrays=arrays, **image), camera)["maps"])

    assert maps(cuboid_sensors.SMALL) == {"depth_m"}
    assert maps(None) == set()
    assert maps(None, image=np.zeros(pixels, np.uint8)) == {"depth_m"}
    arrays["temperature_k"] = np.full((4, 5), 300.0)
    arrays["corner_m"] = np.ones((4, 5))
    assert maps(None) == {"temperature_k", "corner_m"}


def test_of_very_many_readings_some_are_carried(view, tmp_path):
    """As of a lidar at 10 Hz between frames that are six seconds apart."""
    folder = cuboid_sensors.add_readings(cuboid.write_dataset(tmp_path / "d"))
    lines = cuboid.read_lines(folder)
    first = lines[0]["sensors"]["gauge"][0]
    lines[0]["sensors"]["gauge"] = [{**first, "t_s": first["t_s"] + k / 10} for k in range(60)]
    cuboid.write_lines(folder, lines)
    assert view(folder).exit_code == 0
    frame = block(folder / "view.html", "frame-0")
    carried = [k for k, reading in enumerate(frame["preview"]["readings"]["gauge"]) if reading]
    assert len(carried) == MOST_READINGS
    assert (carried[0], carried[-1]) == (0, 59)
    assert np.diff(carried).max() <= 3
    assert len(frame["labels"]["sensors"]["gauge"]) == 60


def test_the_page_keeps_within_its_size(view, page, sensed, tmp_path):
    limit = page.stat().st_size * 0.7
    result = view(sensed, "--out", tmp_path / "small.html", "--max-mib", limit / 2**20)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "small.html").stat().st_size <= limit
    shown = [block(tmp_path / "small.html", f"frame-{index}")["preview"] for index in range(6)]
    assert 1 < sum(preview is not None for preview in shown) < 6
