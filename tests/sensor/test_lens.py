"""A renderer with a distorting lens: edges, radiance and depth against OpenCV and closed forms."""

from collections.abc import Mapping
from dataclasses import replace

import cv2
import numpy as np
import pytest
from by_opencv import flat_of, projected_px
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from posse_core._errors import ComponentError
from posse_core._geometry.raycast import RayCaster
from posse_core._imaging.image_sensor import ImageSensor
from posse_core._imaging.lens import LensRenderer, samples
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.distortion import BrownConrady, Distortion, Fisheye
from posse_core._model.scene import Radiance, RenderRequest
from posse_core._model.sky_view import SkyView
from posse_core._plugins.options import NoOptions
from posse_core._scenario.sensor import NoiseConfig, PsfConfig, SensorConfig
from posse_core.testing import scenes

BARREL = BrownConrady(-0.25, 0.06, 0.002, -0.001, 0.0)
PINCUSHION = BrownConrady(0.12, 0.02, -0.001, 0.002, 0.01)
WEAK = BrownConrady(-0.02, 0.0, 0.001, 0.0, 0.0)
RATIONAL = BrownConrady(0.3, -0.1, 0.001, -0.002, 0.02, 0.5, 0.1, -0.02)
FISHEYE = Fisheye(-0.02, 0.01, -0.003, 0.0005)
LENSES = [BARREL, PINCUSHION, WEAK, RATIONAL, FISHEYE]
HALF_M = np.array([1.3, 0.8])
FINE = 4


class PlateRenderer(Renderer):
    """Renders a rectangle, brighter to the right, by its closed form, averaged over 16 rays per
    pixel."""

    def open(self, scene):
        self.camera = scene.camera
        self.boxes = []

    def render(self, request: RenderRequest) -> Radiance:
        box = request.box
        self.boxes.append(box)
        steps = (np.arange(FINE) + 0.5) / FINE - 0.5
        offsets = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
        position, _ = on_plate(self.camera, request.craft, box.pixel_centres_px()[:, :, None] + offsets)
        hit = (np.abs(position) <= HALF_M).all(axis=-1)
        light = (hit * (2 + position[..., 0])).mean(axis=2)
        _, depth = on_plate(self.camera, request.craft, box.pixel_centres_px())
        return Radiance(
            box,
            np.repeat(light[..., None], 3, -1).astype(np.float32),
            hit.mean(axis=2).astype(np.float32),
            depth.astype(np.float32),
        )

    def close(self):
        pass

    def describe(self) -> Mapping[str, str]:
        return {"plate": "1"}


def on_plate(camera: Camera, craft, uv_px):
    """The points of the plate's plane that pixels see: (..., 2) positions in the plate's axes, and
    depth."""
    R, t = craft.R_cam_from_body, craft.t_body_cam_m
    rays = camera.rays(uv_px)
    z = (R[:, 2] @ t) / (rays @ R[:, 2])
    return ((z[..., None] * rays - t) @ R)[..., :2], z


def camera(distortion: Distortion | None) -> Camera:
    return Camera(80, 60, 52.0, 52.4, 41.2, 28.7, 0.01, distortion=distortion)


def scene(distortion: Distortion | None):
    plate = scenes.rectangle("plate", "grey", u_m=(HALF_M[0], 0, 0), v_m=(0, HALF_M[1], 0))
    material = scenes.Material("grey")
    return scenes.scene(plate, materials=(material,), camera=camera(distortion))


def turned(angle: float, tilt: float) -> np.ndarray:
    return (
        scenes.FACING
        @ cv2.Rodrigues(np.array([0, tilt, 0.0]))[0]
        @ cv2.Rodrigues(np.array([0, 0, angle]))[0]
    )


def frame(x_m=0.9, y_m=-0.6, z_m=3.5, angle=0.35, tilt=0.5):
    return scenes.frame(
        t_body_cam_m=(x_m, y_m, z_m), sun_direction_body=(0, 0, 1), R_cam_from_body=turned(angle, tilt)
    )


def shoot(distortion, at) -> tuple[Radiance, PlateRenderer]:
    inner = PlateRenderer(NoOptions())
    renderer = LensRenderer(inner)
    renderer.open(scene(distortion))
    box = PixelBox(0, 0, 80, 60)
    return renderer.render(RenderRequest(at.craft, box, None, 0)), inner


def outline_px(cam: Camera, at) -> np.ndarray:
    """(N, 2) the plate's curved outline in the image, projected by OpenCV."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * HALF_M
    share = np.linspace(0, 1, 200, endpoint=False)[:, None]
    edge = np.concatenate(
        [a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
    )
    body = np.column_stack([edge, np.zeros(len(edge))])
    points = body @ at.craft.R_cam_from_body.T + at.craft.t_body_cam_m
    return projected_px(cam, points)


def covered(uv: np.ndarray) -> np.ndarray:
    """(60, 80) share of each pixel inside a polygon, from 32² points per pixel."""
    mask = np.zeros((60 * 32, 80 * 32), dtype=np.uint8)
    fixed = np.round(((uv + 0.5) * 32 - 0.5) * 256).astype(np.int32)
    cv2.fillPoly(mask, [fixed], 1, shift=8)
    return mask.reshape(60, 32, 80, 32).mean(axis=(1, 3))


@pytest.mark.parametrize("distortion", LENSES)
def test_edges_are_where_opencv_projects_them(distortion):
    at = frame()
    image, _ = shoot(distortion, at)
    expected = covered(outline_px(camera(distortion), at))
    # The area between the outlines divided by their length. fillPoly also draws the border, 1/64 pixel.
    length = np.linalg.norm(np.diff(outline_px(camera(distortion), at), axis=0), axis=1).sum()
    assert np.abs(image.coverage - expected).sum() / length < 0.15  # within the blur of a pixel
    assert abs((image.coverage - expected).sum()) / length < 0.03
    for axis in (0, 1):  # first moments: the outline is not displaced
        positions = np.arange(image.coverage.shape[axis])
        middle = [
            np.average(positions, weights=c.sum(axis=1 - axis)) for c in (image.coverage, expected)
        ]
        assert middle[0] == pytest.approx(middle[1], abs=0.02)
    straight = covered(outline_px(camera(None), at))
    assert np.abs(straight - expected).sum() / length > 0.05  # the distortion matters here


@pytest.mark.parametrize("distortion", LENSES)
def test_labels_and_image_agree(distortion):
    at = frame()
    image, _ = shoot(distortion, at)
    view = RayCaster(scene(distortion)).view(at.craft)
    mask = np.zeros((60, 80), dtype=bool)
    mask[view.box.slices] = view.mask
    inside = image.coverage > 0.5
    assert (mask & inside).sum() / (mask | inside).sum() > 0.995
    both = mask & np.isfinite(image.depth_m)
    depth = np.full((60, 80), np.nan)
    depth[view.box.slices] = view.depth_m
    np.testing.assert_allclose(image.depth_m[both], depth[both], rtol=2e-6)


@settings(max_examples=8, deadline=None)
@given(
    st.sampled_from(LENSES),
    st.floats(-1.2, 1.2),
    st.floats(-0.8, 0.8),
    # The test's renderer samples edges along rows and columns to a quarter of a pixel: 1 % of the plate.
    st.floats(0.2, 1.3),
    st.sampled_from(["none", "cos4"]),
)
def test_lens_and_psf_conserve_light(distortion, x_m, y_m, angle, vignetting):
    """The electrons of a whole plate with and without distortion agree within 0.5 %."""
    assume(vignetting == "cos4" or not isinstance(distortion, Fisheye))
    at = frame(x_m, y_m, 7.0, angle)
    config = SensorConfig(
        noise=NoiseConfig(shot=False, read_e=0, dark_e_s=0),
        psf=PsfConfig(shape="defocus", diameter_px=3),
        vignetting=vignetting,
    )
    dark = SkyView(None, np.empty((0, 2)), np.empty((0, 3)))
    total = [
        float(
            ImageSensor(config, camera(lens))
            .mean_electrons(dark, shoot(lens, at)[0], 0.002)
            .astype(float)
            .sum()
        )
        for lens in (distortion, None)
    ]
    assert total[0] == pytest.approx(total[1], rel=0.005)


@pytest.mark.parametrize(("vignetting", "power"), [("none", 0), ("cos4", 1)])
def test_pixels_of_a_fisheye_get_light_by_their_solid_angle(vignetting, power):
    """The solid angle of each pixel by the directions of its borders, which OpenCV gives."""
    cam = camera(FISHEYE)
    v, u = np.mgrid[:60, :80].astype(float)
    rays = []
    for du, dv in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5), (0, 0)):
        flat = flat_of(cam, np.stack([u + du, v + dv], -1))
        ray = np.dstack([flat, np.ones_like(u)])
        rays.append(ray / np.linalg.norm(ray, axis=-1, keepdims=True))
    solid_sr = np.linalg.norm(np.cross(rays[0] - rays[1], rays[2] - rays[3]), axis=-1)
    config = SensorConfig(psf=None, vignetting=vignetting)
    sky = SkyView(np.ones((60, 80, 3), np.float32), np.empty((0, 2)), np.empty((0, 3)))
    electrons = ImageSensor(config, cam).mean_electrons(sky, None, 0.002)[..., 0].astype(float)
    share = electrons / (solid_sr * rays[4][..., 2] ** power)
    np.testing.assert_allclose(share, share[29, 41], rtol=2e-3)
    assert solid_sr.min() < 0.9 * solid_sr.max()


def test_distortion_does_not_change_a_stars_electrons():
    config = SensorConfig(psf=None)
    star = SkyView(None, np.array([[10.0, 7.0]]), np.full((1, 3), 1e-9))
    electrons = [
        ImageSensor(config, camera(lens)).mean_electrons(star, None, 0.002).sum()
        for lens in (BARREL, None)
    ]
    assert electrons[0] == pytest.approx(electrons[1], rel=1e-6)


def test_a_box_is_the_slice_of_the_whole_image():
    at = frame()
    whole, _ = shoot(BARREL, at)
    renderer = LensRenderer(PlateRenderer(NoOptions()))
    renderer.open(scene(BARREL))
    box = PixelBox(40, 10, 25, 23)
    part = renderer.render(RenderRequest(at.craft, box, None, 0))
    assert part.box == box
    np.testing.assert_allclose(part.coverage, whole.coverage[box.slices], atol=1e-3)
    np.testing.assert_allclose(part.radiance_rgb, whole.radiance_rgb[box.slices], atol=3e-3)


def test_without_distortion_requests_are_passed_on_unchanged():
    image, inner = shoot(None, frame())
    assert inner.camera == camera(None)
    assert inner.boxes == [PixelBox(0, 0, 80, 60)]
    alone = PlateRenderer(NoOptions())
    alone.open(scene(None))
    expected = alone.render(RenderRequest(frame().craft, PixelBox(0, 0, 80, 60), None, 0))
    assert np.array_equal(image.radiance_rgb, expected.radiance_rgb)


def test_weak_distortion_needs_fewer_samples():
    assert [samples(camera(lens)) for lens in (WEAK, PINCUSHION, BARREL)] == [2, 4, 4]


@pytest.mark.parametrize("pixel", [[70, 50], [8, 52], [74, 30]])
def test_a_plate_far_off_a_fisheyes_axis_is_sampled_closely_enough(pixel):
    """At 62 degrees from the axis, where a pixel is as long as nine of the pinhole's. The plate covers
    the area of its outline by OpenCV."""
    wide = Camera(80, 60, 36.0, 36.0, 39.5, 29.5, 0.01, distortion=Fisheye())
    away = (np.array(pixel) - [39.5, 29.5]) / 36
    theta = np.hypot(*away)
    ray = np.array([*(np.sin(theta) * away / theta), np.cos(theta)])
    facing = cv2.Rodrigues(np.array([-away[1], away[0], 0.0]))[0] @ turned(0.7, 0.4)
    at = scenes.frame(t_body_cam_m=tuple(12 * ray), sun_direction_body=(0, 0, 1), R_cam_from_body=facing)
    renderer = LensRenderer(PlateRenderer(NoOptions()))
    renderer.open(replace(scene(None), camera=wide))
    image = renderer.render(RenderRequest(at.craft, PixelBox(0, 0, 80, 60), None, 0))
    outline = outline_px(wide, at)
    assert ((outline > 1) & (outline < [78, 58])).all()
    area = cv2.contourArea(outline.astype(np.float32))
    assert area > 30
    assert image.coverage.sum(dtype=float) == pytest.approx(area, rel=0.002)


def test_a_wide_image_with_many_samples_is_distorted():
    """Eight samples in each of 5000 columns are more than cv2.remap makes in a row."""
    wide = Camera(5000, 4, 2600.0, 2600.0, 2499.5, 1.5, 0.01, distortion=Fisheye())
    assert samples(wide) * wide.width_px > 32767
    renderer = LensRenderer(PlateRenderer(NoOptions()))
    renderer.open(replace(scene(None), camera=wide))
    at = frame(0, 0, 60.0, angle=0.0, tilt=0.0)
    image = renderer.render(RenderRequest(at.craft, PixelBox(0, 0, 5000, 4), None, 0))
    expected_px = 2 * 2600 * np.arctan(HALF_M[0] / 60)
    assert image.coverage.sum(axis=1) == pytest.approx(np.full(4, expected_px), abs=0.1)


def test_the_pinhole_image_is_finer_than_the_distorted_one_everywhere():
    _, inner = shoot(PINCUSHION, frame())
    cam, fine = camera(PINCUSHION), inner.camera
    assert fine.fx_px == fine.fy_px
    uv = np.array([[0.0, 0.0], [40, 30], [79, 59], [79, 0]])
    for step in ([1.0, 0.0], [0.0, 1.0]):
        across = fine.project(cam.rays(uv + np.array(step))) - fine.project(cam.rays(uv))
        assert np.all(np.linalg.norm(across, axis=1) >= 2 - 0.02)
    inside = fine.project(cam.rays(cam.border_px()))
    assert np.all(inside >= 0)
    assert np.all(inside <= [fine.width_px - 1, fine.height_px - 1])


def test_an_image_too_large_to_distort_is_refused():
    renderer = LensRenderer(PlateRenderer(NoOptions()))
    huge = Camera(16384, 64, 12000.0, 12000.0, 8191.5, 31.5, 0.01, distortion=PINCUSHION)
    with pytest.raises(ComponentError, match=r"need an image of \d+ px.*fewer pixels"):
        renderer.open(replace(scene(PINCUSHION), camera=huge))
