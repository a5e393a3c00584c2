"""Measures of silhouettes and light, against shapes and shifts that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posse_core._arrays import FloatArray
from posse_core._evaluation.crosscheck.light import (
    agreement,
    noise,
    part_light,
    structural_similarity,
)
from posse_core._evaluation.crosscheck.silhouette import (
    FINE,
    Geometry,
    contour_length,
    edge_distance_px,
    edge_shift_px,
    finer,
    iou,
    landmark_errors_px,
)
from posse_core._model.scene import FrameState
from posse_core._model.spacecraft import Material
from posse_core.testing import scenes

WHITE = Material("white", specular=0.0)


def disc(centre: tuple[float, float], radius: float, size: int = 40, fine: int = 12) -> FloatArray:
    """(size, size) coverage of a disc, counted on a lattice of ``fine``² points a pixel."""
    at = (np.arange(size * fine) + 0.5) / fine - 0.5
    inside = (at - centre[0]) ** 2 + (at[:, None] - centre[1]) ** 2 < radius**2
    return np.asarray(inside.reshape(size, fine, size, fine).mean(axis=(1, 3)))


def plate(
    u_m: float, v_m: float, distance_m: float = 4.0, *, turned: float = 0.0
) -> tuple[Geometry, FrameState, float]:
    """A rectangle that faces the camera, turned about its normal: geometry, frame, px a metre."""
    u = (u_m * np.cos(turned), u_m * np.sin(turned), 0.0)
    v = (-v_m * np.sin(turned), v_m * np.cos(turned), 0.0)
    part = scenes.rectangle("plate", "white", u_m=u, v_m=v)
    scene = scenes.scene(part, materials=(WHITE,), camera=scenes.camera())
    frame = scenes.frame(t_body_cam_m=(0.013, 0.021, distance_m), sun_direction_body=(0, 0, 1))
    return Geometry(scene), frame, scene.camera.fx_px / distance_m


@given(turned=st.floats(0, np.pi / 2), u_m=st.floats(0.3, 0.8), v_m=st.floats(0.2, 0.6))
def test_exact_coverage_and_contour_are_the_rectangles(turned: float, u_m: float, v_m: float) -> None:
    geometry, frame, scale = plate(u_m, v_m, turned=turned)
    exact = geometry.exact(frame)
    circumference_px = 4 * (u_m + v_m) * scale
    # A lattice's area is off by a share of its spacing along the contour.
    assert exact.coverage.sum() == pytest.approx(4 * u_m * v_m * scale**2, abs=circumference_px / FINE)
    assert exact.contour_px == pytest.approx(circumference_px, rel=0.07)
    assert exact.depth_m[exact.part_id >= 0] == pytest.approx(4.0)


def test_exact_coverage_sees_what_lies_between_pixel_centres() -> None:
    """A strip a quarter of a pixel high, of which a pixel's centre sees all or nothing."""
    _, _, scale = plate(0.9, 0.1)
    geometry, frame, _ = plate(0.9, 0.125 / scale)
    exact = geometry.exact(frame)
    assert exact.coverage.max() <= 0.375
    assert exact.coverage.sum() == pytest.approx(1.8 * scale * 0.25, rel=0.5)


def test_a_finer_camera_sees_the_same_rays() -> None:
    camera = scenes.camera(40, 30)
    fine = finer(camera, 8)
    corner_px = np.array([-0.5, -0.5])
    np.testing.assert_allclose(camera.rays(corner_px), fine.rays(corner_px), rtol=1e-12)
    last_px = np.array([39.5, 29.5])
    np.testing.assert_allclose(camera.rays(last_px), fine.rays((last_px + 0.5) * 8 - 0.5), rtol=1e-12)


@given(radius=st.floats(15, 200))
def test_contour_of_a_circle(radius: float) -> None:
    size = int(2 * radius) + 8
    at = np.arange(size) - size / 2 + 0.25
    mask = at**2 + at[:, None] ** 2 < radius**2
    assert contour_length(mask) == pytest.approx(2 * np.pi * radius, rel=0.02)


@given(
    right=st.floats(-0.3, 0.3),
    down=st.floats(-0.3, 0.3),
    outward=st.floats(-0.2, 0.2),
)
def test_a_shifted_and_grown_disc_is_found_out(right: float, down: float, outward: float) -> None:
    exact = disc((20.2, 19.7), 15.0)
    moved = disc((20.2 + right, 19.7 + down), 15.0 + outward)
    found = edge_shift_px(moved, exact)
    np.testing.assert_allclose(found, [right, down, outward], rtol=0.2, atol=0.02)
    # Round a circle, |d·n| is 2/π |d| on average; a growth moves every edge by itself.
    distance = edge_distance_px(moved, exact, 2 * np.pi * 15.0)
    moved_by = 2 / np.pi * np.hypot(right, down)
    assert max(moved_by, abs(outward)) - 0.02 <= distance <= moved_by + abs(outward) + 0.02


def test_noise_hides_no_shift() -> None:
    exact = disc((20.0, 20.0), 15.0)
    draws = np.random.Generator(np.random.PCG64(1)).binomial(16, disc((20.1, 20.0), 15.0)) / 16
    np.testing.assert_allclose(edge_shift_px(draws, exact), [0.1, 0.0, 0.0], atol=0.03)


def test_iou() -> None:
    a = np.zeros((4, 4), bool)
    b = a.copy()
    assert iou(a, b) == 1.0
    a[:2], b[1:3] = True, True
    assert iou(a, b) == pytest.approx(1 / 3)


def test_landmarks_that_are_moved_are_told() -> None:
    geometry, frame, _ = plate(0.4, 0.4)
    exact = geometry.exact(frame)
    v, u = np.mgrid[: exact.box.height, : exact.box.width]
    total = exact.coverage.sum()
    place = np.array([(u * exact.coverage).sum() / total, (v * exact.coverage).sum() / total])
    place += [exact.box.x0, exact.box.y0]
    errors = landmark_errors_px(exact.coverage, exact, np.stack([place + np.array([0.3, 0.4])]))
    assert errors == pytest.approx([0.5], abs=1e-6)


def test_agreement_names_the_worst_band_and_leaves_out_what_is_unknown() -> None:
    expected = np.tile([4.0, 2.0, 1.0], (5, 6, 1))
    expected[0] = np.nan
    got = expected * [1.01, 0.97, 1.02]
    got[0] = 1e9
    got[1] = 1e9
    whole = np.ones((5, 6), bool)
    whole[1] = False
    ratio, rms = agreement(got, expected, whole)
    assert ratio == pytest.approx(0.97)
    errors = np.array([0.04, 0.06, 0.02])
    assert rms == pytest.approx(np.sqrt((errors**2).mean()) / (7 / 3))


def test_noise_is_the_standard_deviation() -> None:
    draw = np.random.Generator(np.random.PCG64(2))
    one, other = (draw.normal(10, 0.5, (200, 200, 3)) for _ in range(2))
    # Three bands are summed: σ grows by √3, the mean by 3.
    assert noise(one, other, np.ones((200, 200), bool)) == pytest.approx(0.05 / np.sqrt(3), rel=0.02)


def test_light_by_part() -> None:
    radiance = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    light = part_light(radiance, np.array([[0, 2], [-1, 2]], np.int16), 3)
    assert light.tolist() == [0 + 1 + 2, 0, 3 + 4 + 5 + 9 + 10 + 11]


def test_structural_similarity_of_flat_images_is_its_formula() -> None:
    where = np.ones((30, 30), bool)
    a, b = np.full((30, 30), 0.5), np.full((30, 30), 0.25)
    assert structural_similarity(a, a, where) == pytest.approx(1.0)
    formula = (2 * 0.5 * 0.25 + 1e-4) / (0.5**2 + 0.25**2 + 1e-4)
    assert structural_similarity(a, b, where) == pytest.approx(formula)


def test_structural_similarity_of_noise_falls_as_its_formula() -> None:
    """a = s + n₁, b = s + n₂: σ_ab = σ_s², σ_a² = σ_s² + σ_n², for patterns finer than the window."""
    draw = np.random.Generator(np.random.PCG64(3))
    s, n1, n2 = (draw.normal(0, sigma, (300, 300)) for sigma in (0.1, 0.05, 0.05))
    where = np.ones((300, 300), bool)
    expected = (2 * 0.01 + 9e-4) / (2 * 0.0125 + 9e-4)
    assert structural_similarity(0.5 + s + n1, 0.5 + s + n2, where) == pytest.approx(expected, abs=0.02)
