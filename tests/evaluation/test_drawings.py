"""The fit of a drawing and a picture, on cubes whose shading has a closed form."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from posse_core._evaluation.drawings import Drawing, Slopes

SHAPE = (120, 160)
V, U = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
FACES = st.lists(st.floats(0.1, 1.0), min_size=3, max_size=3)
ANGLES = st.floats(0.1, 1.0)
DIRECTIONS = [(2 * u, 2 * v) for u in (-1, 0, 1) for v in (-1, 0, 1) if u or v]


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


def drawing_of(light, covered):
    """As drawn in the light given, and in one that makes all of it as bright."""
    return Drawing(light, covered.astype(np.float32), covered)


@given(FACES, ANGLES, st.floats(0.05, 0.9), st.floats(0, 0.01), st.integers(0, 10**6))
def test_a_drawing_fits_its_own_picture_at_any_exposure(faces, angle, exposure, noise, seed):
    light, covered = cube(faces, angle)
    grain = noise * exposure * np.random.default_rng(seed).random(SHAPE)
    slopes = Slopes((exposure * light + grain).astype(np.float32))
    drawing = drawing_of(light, covered)
    got = drawing.fit(slopes)
    assert got.correlation > 0.6
    assert got.shift_px == pytest.approx((0, 0), abs=0.6)
    assert drawing.correlation(slopes) == pytest.approx(got.correlation, abs=1e-4)


@given(FACES, ANGLES, st.integers(-6, 6), st.integers(-6, 6))
def test_the_shift_of_a_picture_is_found(faces, angle, u_px, v_px):
    light, covered = cube(faces, angle)
    got = drawing_of(light, covered).fit(Slopes(0.5 * np.roll(light, (v_px, u_px), axis=(0, 1))))
    assert got.shift_px == pytest.approx((u_px, v_px), abs=0.3)
    assert got.is_shifted == (max(abs(u_px), abs(v_px)) >= 2)
    assert got.best == pytest.approx(1, abs=1e-3)


@given(FACES, ANGLES, st.floats(0, 0.1), st.integers(0, 10**6))
def test_the_sharpness_is_what_a_shifted_picture_loses(faces, angle, noise, seed):
    """So whoever is told that a frame is proven knows that a shift of it would have been found."""
    light, covered = cube(faces, angle)
    picture = (light + noise * np.random.default_rng(seed).random(SHAPE)).astype(np.float32)
    drawing = drawing_of(light, covered)
    whole = drawing.fit(Slopes(picture))
    assume(max(map(abs, whole.shift_px)) < 0.6)
    fits = [drawing.fit(Slopes(np.roll(picture, (v, u), axis=(0, 1)))) for u, v in DIRECTIONS]
    lost = [fit.best - fit.correlation for fit in fits]
    assert min(lost) == pytest.approx(whole.sharpness, abs=1e-3)
    assert whole.sharpness > 0.04


def test_a_bar_across_the_image_does_not_tell_a_shift_along_it():
    covered = np.abs(V - 60) < 10
    got = drawing_of(covered.astype(np.float32), covered).fit(Slopes(0.5 * covered.astype(np.float32)))
    assert got.correlation == pytest.approx(1, abs=1e-3)
    assert got.sharpness < 0.01


@given(FACES, ANGLES, st.floats(1.2, 3.0))
def test_what_is_behind_may_be_brighter(faces, angle, behind):
    light, covered = cube(faces, angle)
    drawing = drawing_of(light, covered)
    picture = np.where(covered, light, behind).astype(np.float32)
    got = drawing.fit(Slopes(picture))
    assert got.correlation > 0.5
    assert got.shift_px == pytest.approx((0, 0), abs=0.6)


@given(FACES, ANGLES)
def test_a_body_in_shadow_is_told_by_the_light_from_all_around(faces, angle):
    light, covered = cube(faces, angle)
    dark = np.where(U < 80, light, 0).astype(np.float32)
    picture = Slopes(0.1 * covered.astype(np.float32))
    one_light = Drawing(dark, dark, covered).correlation(picture)
    both = Drawing(dark, covered.astype(np.float32), covered).correlation(picture)
    assert both == pytest.approx(1, abs=1e-3)
    assert one_light < 0.9


@given(FACES, ANGLES, st.floats(0, 1))
def test_the_mix_of_two_lights_fits_better_than_either(faces, angle, share):
    light, covered = cube(faces, angle)
    even = covered.astype(np.float32)
    picture = Slopes((share * light + (1 - share) * even).astype(np.float32))
    alone = [Drawing(each, each, covered).correlation(picture) for each in (light, even)]
    assert Drawing(light, even, covered).correlation(picture) >= max(alone) - 1e-5


@given(FACES, ANGLES, st.integers(0, 10**6))
def test_noise_fits_no_drawing(faces, angle, seed):
    light, covered = cube(faces, angle)
    noise = np.random.default_rng(seed).random(SHAPE).astype(np.float32)
    assert drawing_of(light, covered).correlation(Slopes(noise)) < 0.2


@pytest.mark.parametrize(("x", "y"), [(True, False), (False, True), (True, True)])
def test_the_mirrored_slopes_are_those_of_the_mirrored_picture(x, y):
    light = np.random.default_rng(0).random(SHAPE).astype(np.float32)
    flipped = np.ascontiguousarray(light[:: -1 if y else 1, :: -1 if x else 1])
    inside = np.s_[:, 1:-1, 1:-1]
    assert np.allclose(
        Slopes(light).mirrored(x, y).field[inside], Slopes(flipped).field[inside], atol=1e-3
    )


def test_a_body_at_the_border_of_the_image_is_compared_where_it_is_seen():
    light, covered = cube([0.9, 0.5, 0.2], 0.4, u=4, v=3)
    got = drawing_of(light, covered).fit(Slopes(0.5 * light))
    assert got.correlation > 0.9
    assert got.shift_px == pytest.approx((0, 0), abs=0.6)


def test_a_black_picture_fits_nothing_and_a_white_one_tells_nothing():
    light, covered = cube([0.9, 0.5, 0.2], 0.4)
    for even in (np.zeros(SHAPE, np.float32), np.ones(SHAPE, np.float32)):
        got = drawing_of(light, covered).fit(Slopes(even))
        assert got.correlation == pytest.approx(0, abs=1e-3)
        assert got.sharpness == pytest.approx(0, abs=1e-3)
