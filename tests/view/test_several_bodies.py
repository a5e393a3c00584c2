"""A page of several bodies in headless Chromium: all of them are drawn, with names and joints."""

import company
import numpy as np
import pytest
from pycocotools import mask as coco_mask

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

IMAGES = company.images()
SIZES_M = {"plate": 2.8, "winged": 4.4}
"""Longest side of the box around each spacecraft with its joints at zero: −0.8 … 3.6 m along y."""

TELL = """
    told.axes = columns.index.map((_, place) =>
      bodiesOf(frameAt(place).labels).map(([, body, craft]) => bodyAxes(body, dataset.camera, craft)));
    told.parts = partNames(frameAt(0).labels);
    told.facts = columns.index.map((_, place) => { select(place); return byId("facts").innerText; });
    select(0);
    Object.assign(picture.canvas.style, {width: "160px", height: "120px"});
    const drawn = (name) => {
      picture.shown = new Set([name]);
      picture.image = null;
      picture.draw();
      const data = picture.canvas.getContext("2d").getImageData(0, 0, 160, 120).data, pixels = [];
      for (let i = 0; i < data.length; i += 4) pixels.push([...data.slice(i, i + 3)]);
      return pixels;
    };
    told.mask = drawn("mask");
    told.box = drawn("box");
    told.whole = JSON.stringify(frameAt(0).labels).includes("part_area_px");
"""


@pytest.fixture(scope="module")
def told(browse, view, tmp_path_factory):
    folder = company.write_dataset(tmp_path_factory.mktemp("company") / "d")
    assert view(folder).exit_code == 0
    return browse(folder / "view.html", TELL)


def test_axes_of_every_body_are_where_its_pose_puts_them(told):
    assert told["errors"] == []
    K = company.CAMERA.matrix
    for found, image in zip(told["axes"], IMAGES, strict=True):
        for axes, member in zip(found, image.members, strict=True):
            tips = np.vstack([np.zeros(3), np.eye(3)]) * SIZES_M[member.name] / 2
            x_cam = tips @ member.R.T + member.t
            expected = (x_cam / x_cam[:, 2:]) @ K[:2].T
            for tip, wanted, z_m in zip(axes, expected, x_cam[:, 2], strict=True):
                assert tip == (pytest.approx(wanted, abs=1e-6) if z_m > 0 else None)


def test_masks_and_boxes_of_every_body_are_drawn_each_in_its_colour(told):
    image = IMAGES[0]
    pixels = np.array(told["mask"]).reshape(120, 160, 3)
    ground = (pixels == [7, 9, 11]).all(axis=-1)
    assert np.array_equal(~ground, image.body >= 0)
    outlines = []
    for number in range(3):
        mask = coco_mask.decode(image.labels(number)["mask_rle"]) > 0
        padded = np.pad(mask, 1)
        inner = mask & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
        (colour,) = {tuple(c) for c in pixels[mask & ~inner].tolist()}
        outlines.append(colour)
    assert len(set(outlines)) == 3
    boxes = np.array(told["box"]).reshape(120, 160, 3)
    for number in range(3):
        x, y, _, height = image.labels(number)["box_visible_px"]
        left = boxes[y + 2 : y + height - 2, x - 1 : x + 1]
        assert (left.astype(int).sum(axis=-1).max(axis=1) > 100).mean() > 0.9


def test_facts_have_joints_and_bodies(told):
    for facts, image in zip(told["facts"], IMAGES, strict=True):
        target, plate, _ = image.members
        assert f"Joint wing\t{np.degrees(target.wing_rad):.3f}°, 0 °/s" in facts
        assert f"companion\tplate, {np.linalg.norm(plate.t):.3f} m, in the image" in facts
        assert "twin\twinged" in facts


def test_parts_of_all_bodies_are_named_by_their_ids(told):
    names = [part.name for part in company.spacecraft("winged").parts]
    plate = [part.name for part in company.spacecraft("plate").parts]
    assert told["parts"] == [
        *names,
        *(f"companion: {name}" for name in plate),
        *(f"twin: {name}" for name in names),
    ]
    assert told["whole"] is False
