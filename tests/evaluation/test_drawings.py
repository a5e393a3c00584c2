"""The fit of a drawing and a picture, on cubes whose shading has a closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._evaluation.drawings import Drawing

SHAPE = (120, 160)
V, U = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
FACES = st.lists(st.floats(0.1, 1.0), min_size=3, max_size=3)
ANGLES = st.floats(0.1, 1.0)


def cube(faces, angle, u=80, v=60, side=22.0):
    """(H, W) light of a cube that stands on a corner: three rhombi of even light, and where they are."""
    light, covered = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, bool)
    edges = [side * np.array([np.cos(a), np.sin(a)]) for a in angle + np.arange(3) * 2 * np.pi / 3]
    for face, (one, two) in zip(faces, ((0, 1), (1, 2), (2, 0)), strict=True):
        s, t = np.linalg.solve(
            np.stack([edges[one], edges[two]], axis=1), np.stack([U - u, V - v]).reshape(2, -1)
        ).reshape(2, *SHAPE)
        inside = (s >= 0) & (s < 1) & (t >= 0) & (t < 1)
        light[inside], covered = face, covered | inside
    return light, covered


@given(FACES, ANGLES, st.floats(0.05, 0.9), st.floats(0, 0.01), st.integers(0, 10**6))
def test_a_drawing_fits_its_own_picture_at_any_exposure(faces, angle, exposure, noise, seed):
    light, covered = cube(faces, angle)
    drawing = Drawing(light, covered, 1)
    grain = noise * exposure * np.random.default_rng(seed).random(SHAPE)
    got = drawing.fit((exposure * light + grain).astype(np.float32))
    assert got.correlation > 0.9
    assert got.shift_px == (0, 0)


@given(FACES, ANGLES, st.integers(-6, 6), st.integers(-6, 6))
def test_the_shift_of_a_picture_is_found(faces, angle, u_px, v_px):
    light, covered = cube(faces, angle)
    got = Drawing(light, covered, 1).fit(0.5 * np.roll(light, (v_px, u_px), axis=(0, 1)))
    assert got.shift_px == (u_px, v_px)
    assert got.steps == max(abs(u_px), abs(v_px))
    assert got.best == pytest.approx(1, abs=1e-3)


@given(FACES, ANGLES, st.integers(0, 10**6))
def test_noise_fits_no_drawing(faces, angle, seed):
    light, covered = cube(faces, angle)
    noise = np.random.default_rng(seed).random(SHAPE).astype(np.float32)
    assert abs(Drawing(light, covered, 1).fit(noise).correlation) < 0.2


def test_steps_of_several_pixels_give_shifts_in_pixels():
    light, covered = cube([0.9, 0.5, 0.2], 0.4)
    drawing = Drawing(light, covered, 3)
    large = np.kron(np.roll(light, 2, axis=1), np.ones((3, 3), np.float32))
    assert drawing.fit(0.5 * large).shift_px == (6, 0)


def test_a_body_at_the_border_of_the_image_is_compared_where_it_is_seen():
    light, covered = cube([0.9, 0.5, 0.2], 0.4, u=4, v=3)
    assert Drawing(light, covered, 1).fit(0.5 * light).correlation > 0.9


def test_a_black_picture_fits_nothing_and_a_white_one_tells_nothing():
    light, covered = cube([0.9, 0.5, 0.2], 0.4)
    drawing = Drawing(light, covered, 1)
    assert drawing.fit(np.zeros(SHAPE, np.float32)).correlation == pytest.approx(0, abs=1e-3)
    assert drawing.fit(np.ones(SHAPE, np.float32)) is None
