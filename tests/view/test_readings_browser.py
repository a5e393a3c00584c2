"""Sensors' readings in headless Chromium: what is drawn, against the arrays, SciPy and pycocotools."""

import re
import shutil

import cuboid
import cuboid_sensors
import cv2
import numpy as np
import pytest
from pycocotools import mask as coco_mask
from scipy.spatial.transform import Rotation

from posse_core._dataset.dataset import Dataset

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

FRAME = 1

TELL = """
    const tile = (name) => sensors.tiles.find((one) => one.name === name);
    const ways = (one) => Object.keys(one.ways).filter((way) => one.ways[way] === one.way);
    const texts = (choice) => [...choice.options].map((option) => option.text);
    told.names = sensors.tiles.map((one) => [one.name, ...ways(one), texts(one.choose)]);

    // A canvas as large as the sensor's image, so that its pixels are those of the canvas.
    const drawn = (one, way, [W, H]) => {
      const { canvas } = one.ways[way];
      Object.assign(canvas.style, { inset: "auto", width: `${W}px`, height: `${H}px` });
      one.draw();
      return [...canvas.getContext("2d").getImageData(0, 0, W, H).data];
    };
    picture.shown = new Set();
    told.map = drawn(tile("warmth"), "flat", [80, 60]);
    told.scale = tile("warmth").ways.flat.scale.canvas.getAttribute("aria-label");
    tile("warmth").ways.flat.from.value = 0.9;
    tile("warmth").ways.flat.from.oninput();
    told.upper = drawn(tile("warmth"), "flat", [80, 60]);
    told.upperScale = tile("warmth").ways.flat.scale.canvas.getAttribute("aria-label");

    const events = tile("eye").ways.events;
    const large = drawn(tile("eye"), "events", [640, 480]);
    const middle = (i) => 4 * (640 * (8 * Math.floor(i / 80) + 4) + 8 * (i % 80) + 4);
    told.events = Array.from({ length: 80 * 60 }, (_, i) => large.slice(middle(i), middle(i) + 3));
    told.ranges = [[1, 1], [0.8, 1], [1, 1 - Math.log(2) / Math.log(1000)]].map(([until, over]) => {
      events.until.value = until;
      events.over.value = over;
      events.draw();
      return [...events.window, events.text.textContent];
    });

    picture.shown = new Set(["mask"]);
    tile("second").ways.flat.image = null;
    told.mask = drawn(tile("second"), "flat", [160, 120]);

    const cloud = tile("scanner").ways.cloud;
    told.colours = texts(cloud.colour);
    told.parts = cloud.names.textContent;
    Object.assign(cloud, { yaw: 0.7, pitch: 0.3 });
    dataset.spacecraft.brick.middle_body_m = [0.3, -0.2, 0.1];
    const points = columns.index.map((_, i) => Array.from(cloud.xyz.subarray(3 * i, 3 * i + 3)));
    told.cloud = { perMetre: cloud.perMetre, size: [cloud.canvas.clientWidth, cloud.canvas.clientHeight],
      points, at: points.map((point) => cloud.toCanvas(point)) };
    const near = [0, 0, -0.5].map((value, i) => value + cloud.middle[i]);
    const hand = (type, x, y) => cloud.canvas.dispatchEvent(
      new PointerEvent(type, { clientX: x, clientY: y, pointerId: 1 }));
    cloud.canvas.setPointerCapture = () => {};   // there is no real pointer
    cloud.canvas.dispatchEvent(new MouseEvent("dblclick"));
    told.before = [cloud.toCanvas(near), cloud.perMetre];
    hand("pointerdown", 100, 100);
    for (const [x, y] of [[106, 100], [106, 112]]) hand("pointermove", x, y);
    hand("pointerup", 106, 112);
    const { left, top, width, height } = cloud.canvas.getBoundingClientRect();
    cloud.canvas.dispatchEvent(new WheelEvent("wheel",
      { deltaY: -100, cancelable: true, clientX: left + width / 2, clientY: top + height / 2 }));
    told.after = [cloud.toCanvas(near).map((value, i) => value - told.before[0][i]), cloud.perMetre];
    cloud.colour.value = "range";
    cloud.colour.onchange();
    told.range = cloud.scale.canvas.getAttribute("aria-label");
    cloud.colour.value = "intensity";
    cloud.colour.onchange();
    told.intensity = cloud.scale.canvas.getAttribute("aria-label");

    told.contents = [...tile("gauge").way.body.querySelectorAll("tr")].map((row) => row.textContent);
    told.heat = Array.from({ length: 101 }, (_, i) => ramp(i / 100, HEAT));

    const pressed = (key) => new KeyboardEvent("keydown", { key, bubbles: true });
    const where = () => [state.current, sensors.at, location.hash, tile("scanner").instant.textContent,
      tile("eye").instant.textContent];
    told.steps = [where()];
    for (const name of [".", ".", ".", ".", ".", ",", ",", "ArrowRight", "ArrowLeft", ","]) {
      document.body.dispatchEvent(pressed(name));
      told.steps.push(where());
    }
    location.hash = "#frame=4&reading=2";
    window.onhashchange();
    told.steps.push(where());
"""


def rgba(values, camera):
    return np.array(values, np.uint8).reshape(camera.height_px, camera.width_px, 4)


@pytest.fixture(scope="module")
def told(browse, view, sensed):
    assert view(sensed).exit_code == 0
    return browse(sensed / "view.html", TELL, f"#frame={FRAME}")


@pytest.fixture(scope="module")
def truth(sensed):
    return Dataset(sensed).truth(FRAME)


def test_what_is_shown_follows_from_the_reading(told):
    assert told["errors"] == []
    assert told["names"] == [
        ["eye", "events", ["events", "contents"]],
        ["gauge", "contents", ["contents"]],
        ["scanner", "cloud", ["points", "contents"]],
        ["second", "flat", ["image", "contents"]],
        ["warmth", "flat", ["brightness temperature, K", "temperature, K", "contents"]],
    ]


def test_warmer_is_lighter(told, truth):
    """Lightness is CIE's L*."""
    temperature_k = cuboid_sensors.temperatures(truth)["brightness_temperature_k"]
    drawn = rgba(told["map"], cuboid_sensors.SMALL)
    lightness = cv2.cvtColor(drawn[..., :3], cv2.COLOR_RGB2LAB)[..., 0].astype(int)
    kinds = [np.unique(lightness[temperature_k == value]) for value in np.unique(temperature_k)]
    assert len(kinds) == 4
    assert all(len(kind) == 1 for kind in kinds)
    assert np.diff([kind[0] for kind in kinds]).min() > 0
    assert told["scale"] == "brightness temperature, 150 to 330 K"


def test_a_part_of_the_temperatures_has_all_colours(told, truth):
    temperature_k = cuboid_sensors.temperatures(truth)["brightness_temperature_k"]
    assert told["upperScale"] == "brightness temperature, 297.4 to 330 K"
    drawn = rgba(told["upper"], cuboid_sensors.SMALL)[..., :3].sum(axis=-1)
    assert drawn[temperature_k < 297].max() < 10
    assert drawn[temperature_k > 329].min() > 600


def test_the_colours_of_heat_are_perceptual(told):
    """Equal steps in temperature are equal steps in L*, within a quarter of the mean step."""
    heat = np.array(told["heat"], np.float32)[None] / 255
    lightness = cv2.cvtColor(heat, cv2.COLOR_RGB2LAB)[0, :, 0]
    assert np.diff(lightness).min() > 0
    coarse = np.diff(lightness[::10])
    assert np.abs(coarse / coarse.mean() - 1).max() < 0.35


def test_events_have_their_pixels_and_polarity(told, truth):
    events = cuboid_sensors.events(truth)
    red, _, blue = np.moveaxis(np.array(told["events"]).reshape(60, 80, 3), -1, 0)
    there = np.zeros((60, 80))
    there[events["y"], events["x"]] = np.where(events["p"], 1, -1)
    assert set(np.unique(there)) == {-1, 0, 1}
    assert np.array_equal((red > blue + 50).astype(int) - (blue > red + 50), there)


def test_events_are_accumulated_over_a_part_of_the_time(told, truth):
    t_us = cuboid_sensors.events(truth)["t_us"]
    last = t_us.max()
    for (from_us, until_us, text), (low, high) in zip(
        told["ranges"], [(0, last), (-0.2 * last, 0.8 * last), (last / 2, last)], strict=True
    ):
        assert [from_us, until_us] == pytest.approx([low, high], abs=0.002 * last)
        inside = np.count_nonzero((t_us >= low - 0.005 * last) & (t_us <= high + 1))
        least = np.count_nonzero((t_us >= low + 0.005 * last) & (t_us <= high - 1))
        count = int(re.search(r": (\d+) events", text)[1])
        assert least <= count <= inside
        assert count > 0


def test_labels_are_drawn_over_a_readings_image(told, sensed):
    labels = Dataset(sensed)[FRAME].sensors["second"][0].labels
    ground = [7, 9, 11, 255]
    drawn = (rgba(told["mask"], cuboid.CAMERA) != ground).any(axis=-1)
    assert np.array_equal(drawn, coco_mask.decode(labels["mask_rle"]))


def test_points_turn_about_the_middle_of_the_spacecraft(told, sensed):
    """By SciPy: first about the sensor's y, then about the x of the view."""
    cloud, reading = told["cloud"], Dataset(sensed)[FRAME].sensors["scanner"][0]
    turn = Rotation.from_euler("x", 0.3) * Rotation.from_euler("y", 0.7)
    w, x, y, z = reading.q_sensor_from_body
    middle_m = Rotation.from_quat([x, y, z, w]).apply([0.3, -0.2, 0.1]) + reading.t_body_sensor_m
    relative_m = np.array(cloud["points"]) - middle_m
    expected = turn.apply(relative_m)[:, :2] * cloud["perMetre"] + np.array(cloud["size"]) / 2
    np.testing.assert_allclose(cloud["at"], expected, atol=1e-3)
    assert cloud["perMetre"] * 2 * cuboid.HALF.max() == pytest.approx(0.75 * min(cloud["size"]))


def test_the_front_follows_the_pointer_and_the_wheel_zooms(told):
    (place, before), ((right, down), after) = told["before"], told["after"]
    assert place == pytest.approx(np.array(told["cloud"]["size"]) / 2)
    assert right > 0
    assert down > right
    assert after > before


def test_points_are_coloured_by_what_there_is(told, truth):
    scan = cuboid_sensors.scans(truth)[0]
    assert told["colours"] == ["part", "intensity", "range"]
    seen = {cuboid.SIDES[part] for part in np.unique(scan["part_id"]) if part >= 0}
    assert set(told["parts"].split()) == seen
    range_m = np.linalg.norm(scan["point_sensor_m"], axis=1)
    low, high = map(float, re.findall(r"[\d.]+", told["range"]))
    assert (low, high) == pytest.approx((np.nanmin(range_m), np.nanmax(range_m)), rel=1e-3)
    intensity = np.log10(scan["intensity_e"])
    low, high = map(float, re.findall(r"[\d.]+", told["intensity"]))
    assert (low, high) == pytest.approx((np.nanmin(intensity), np.nanmax(intensity)), rel=1e-3)


def test_another_sensors_reading_is_a_table(told):
    assert told["contents"] == [
        "dose_gy0.25",
        "keypoints[1,2]",
        'box_visible_px{"<b>":"</script>"}',
        "x3, float64",
        "t_us4, int64",
        "spectrum2 × 3 × 4, float32",
        f"sensors/gauge/{FRAME:06d}.npz",
    ]


def test_readings_are_stepped_through(told):
    """Five scans a frame, two seconds apart; the others have one reading, which stays."""

    def at(frame, scan):
        hash_ = f"#frame={frame}" + (f"&reading={scan}" if scan else "")
        return [frame, scan, hash_, f"{scan + 1} of 5, +{2 * scan}.000 s", "+0.000 s"]

    forwards = [at(1, 0), at(1, 1), at(1, 2), at(1, 3), at(1, 4), at(2, 0)]
    assert told["steps"][:6] == forwards
    assert told["steps"][6:] == [at(1, 4), at(1, 3), at(2, 0), at(1, 0), at(0, 4), at(4, 2)]


def test_a_page_elsewhere_shows_what_it_holds(browse, view, sensed, tmp_path):
    """The page without the dataset's folder; of some frames it has no preview either."""
    page = tmp_path / "page.html"
    shutil.copytree(sensed, tmp_path / "d")
    assert view(tmp_path / "d", "--out", page).exit_code == 0
    text = re.sub(
        r'("labels":\{"index":2.*?"preview":)\{.*\}</script>', r"\1null}</script>", page.read_text()
    )
    page.write_text(text)
    shutil.rmtree(tmp_path / "d")
    told = browse(
        page,
        """
        told.notes = sensors.tiles.map((tile) => tile.note.textContent);
        select(2);
        told.without = sensors.tiles.map((tile) => [tile.choose.value, tile.note.textContent]);
        """,
        f"#frame={FRAME}",
    )
    assert told["errors"] == []
    eye, gauge, scanner, second, warmth = told["notes"]
    assert (gauge, warmth) == ("", "")
    assert re.fullmatch(r"\d+ events", eye)
    assert re.fullmatch(r"\d+ points", scanner)
    assert second == "preview; the image is not beside this page"
    missing = ["contents", "what this reading holds is not in the page"]
    assert told["without"] == [missing, missing, missing, ["image", ""], missing]
