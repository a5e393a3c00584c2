"""The room in place of space: its boxes against the solid angle of a pyramid, and what is drawn."""

import numpy as np
import pytest
from pydantic import ValidationError

from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._scenario.sky import LaboratoryConfig, SkyConfig
from posse_core._sky.environment import room_map
from posse_core._sky.laboratory import Room
from posse_core._sky.sky import Sky

DARK = {"earth": False, "stars": None, "sun_disc": False}
NO_WALLS = {"wall_w_m2_sr": (0.0, 0.0)}


def in_front(side_deg, w_m2_sr, turn=None):
    """A room with one square box ahead, or where a rotation takes it, and black walls."""
    return Room(
        boxes=(np.eye(3) if turn is None else turn)[None],
        half_sides=np.full((1, 2), np.tan(np.radians(side_deg) / 2)),
        boxes_w_m2_sr=np.array([w_m2_sr]),
        patches=np.zeros((0, 3)),
        sharpness=np.zeros(0),
        patches_w_m2_sr=np.zeros(0),
    )


@pytest.mark.parametrize("side_deg", [20.0, 50.0, 110.0])
def test_the_map_has_the_light_of_a_box(side_deg):
    """A square pyramid with the half-angle a has the solid angle 4 arcsin(sin² a)."""
    turn = np.array([[1.0, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    light = room_map(in_front(side_deg, 700.0, turn)).radiance_rgb.astype(np.float64)
    edges = np.cos(np.pi * np.arange(len(light) + 1) / len(light))
    pixel_sr = -np.diff(edges) * 2 * np.pi / light.shape[1]
    total = np.einsum("i,ijb->b", pixel_sr, light)
    half = np.radians(side_deg) / 2
    assert total.sum() == pytest.approx(700.0 * 4 * np.arcsin(np.sin(half) ** 2), rel=0.02)
    np.testing.assert_allclose(
        total / total.sum(), SOLAR_BAND_FRACTIONS / SOLAR_BAND_FRACTIONS.sum(), rtol=1e-5
    )


def test_a_box_has_its_borders_in_the_image():
    """Ahead of a lens of 90°, 320 pixels wide, a box of 40° is 2 · 160 · tan 20° pixels wide."""
    room = in_front(40.0, 100.0)
    u = np.arange(320) - 159.5
    rays = np.stack([u / 160, np.zeros(320), np.ones(320)], axis=-1)
    across = room.radiance_rgb(rays).sum(axis=-1)
    assert across.max() == pytest.approx(100.0, rel=1e-5)
    assert np.sum(across > 50.0) == pytest.approx(320 * np.tan(np.radians(20)), abs=1)
    assert not room.radiance_rgb(-rays).any()


def test_image_and_map_show_the_same_room(make_camera, make_state):
    config = LaboratoryConfig(boxes=(2, 2), off_axis_deg=0.0, wall_w_m2_sr=(1.0, 30.0))
    camera = make_camera(64, 48, hfov_deg=100.0)
    sky = Sky(SkyConfig(**DARK, laboratory=config), camera, seed=4)
    state = make_state(index=7)
    image = sky.look(state).radiance_rgb
    light = sky.environment(state).radiance_rgb
    rows, columns, _ = light.shape
    v, u = np.mgrid[4:44:6, 4:60:6]
    d = camera.rays(np.stack([u, v], axis=-1).astype(float))
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    row = (np.arccos(-d[..., 1]) / np.pi * rows).astype(int)
    column = ((np.arctan2(d[..., 0], d[..., 2]) + np.pi) / (2 * np.pi) * columns).astype(int)
    seen, mapped = image[v, u].sum(axis=-1), light[row, column].sum(axis=-1)
    smooth = np.abs(seen - mapped) < 0.1 * np.maximum(seen, 1.0)
    assert smooth.mean() > 0.9  # not at the borders of boxes


def test_each_frame_has_a_room_of_its_own(make_camera, make_state):
    config = LaboratoryConfig(boxes=(1, 3), box_deg=(20.0, 50.0), off_axis_deg=60.0, **NO_WALLS)
    rooms = [Room.drawn(config, 5, index) for index in range(200)]
    assert {len(room.boxes) for room in rooms} == {1, 2, 3}
    middles = np.concatenate([room.boxes[:, :, 2] for room in rooms])
    assert np.degrees(np.arccos(middles[:, 2])).min() > 60.0
    # Evenly on the sphere beyond 60°: the mean of z between −1 and cos 60° is −0.25.
    assert middles[:, 2].mean() == pytest.approx(-0.25, abs=0.08)
    light = np.concatenate([room.boxes_w_m2_sr for room in rooms])
    assert light.min() > 300.0
    assert light.max() < 5000.0
    sides = np.degrees(2 * np.arctan(np.concatenate([room.half_sides for room in rooms])))
    assert sides.min() > 20.0
    assert sides.max() < 50.0
    np.testing.assert_array_equal(Room.drawn(config, 5, 3).boxes, rooms[3].boxes)
    assert not np.array_equal(Room.drawn(config, 6, 3).boxes_w_m2_sr, rooms[3].boxes_w_m2_sr)
    sky = Sky(SkyConfig(**DARK, laboratory=config), make_camera(64, 48, hfov_deg=30.0), seed=5)
    assert sky.look(make_state(index=3)).radiance_rgb is None  # black walls, and no box is behind


def test_walls_are_as_bright_as_they_may_be():
    config = LaboratoryConfig(boxes=(0, 0), wall_w_m2_sr=(3.0, 8.0))
    directions = np.random.default_rng(0).standard_normal((4000, 3))
    brightest = [
        Room.drawn(config, 1, index).radiance_rgb(directions).sum(axis=-1).max() for index in range(50)
    ]
    assert max(brightest) < 8.0
    assert min(brightest) > 3.0 / 6


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"laboratory": {}}, "give earth: false and stars: null"),
        ({"earth": False, "laboratory": {}}, "give earth: false and stars: null"),
        ({**DARK, "laboratory": {"boxes": [3, 1]}}, "least and the greatest number"),
        ({**DARK, "laboratory": {"box_deg": [0, 10]}}, "least and the greatest side"),
        ({**DARK, "laboratory": {"box_w_m2_sr": [5, 1]}}, "least and the greatest radiance, above 0"),
        ({**DARK, "laboratory": {"wall_w_m2_sr": [5, 1]}}, "least and the greatest radiance, from 0"),
    ],
)
def test_what_cannot_be_is_refused(keys, words):
    with pytest.raises(ValidationError, match=words):
        SkyConfig(**keys)
