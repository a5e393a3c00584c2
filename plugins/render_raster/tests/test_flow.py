"""The renderer's images agree with the core's optical flow: the next image, warped back, is this one."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from moving_plate import moving, plate
from scipy.spatial.transform import Rotation
from sequences import look_at, posed

from posse_core import FloatArray, FrameState, Material, PixelBox, RenderRequest
from posse_core._annotators.flow import OpticalFlowAnnotator
from posse_core._plugins.options import NoOptions

SUN_BODY = np.array([0.3, -0.2, -0.9]) / np.linalg.norm([0.3, -0.2, -0.9])


def lit(turn: tuple[float, float, float], t_body_cam_m: tuple[float, float, float]) -> FrameState:
    """A pose under a Sun that stands still in body axes: a Lambertian surface keeps its light."""
    R = Rotation.from_rotvec(turn).as_matrix()
    frame = posed(moving(), R, np.array(t_body_cam_m))
    return replace(frame, craft=replace(frame.craft, sun_direction_cam=R @ SUN_BODY))


def test_the_next_image_warped_back_by_the_flow_is_this_image(opened) -> None:
    v, u = np.mgrid[:64, :64] / 64 * 2 * np.pi
    waves = np.stack([np.sin(u) + np.cos(v), np.sin(2 * v), np.cos(u + v)], axis=-1)
    material = Material(
        "grey", specular=0.0, base_color_texture=np.round(160 + 45 * waves).astype(np.uint8)
    )
    scene = plate()
    painted = replace(scene.spacecraft.parts[0], uv=np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]))
    scene = replace(
        scene, spacecraft=replace(scene.spacecraft, parts=(painted,), materials={"grey": material})
    )
    now, then = lit((0.3, 0.2, 0.1), (0.0, 0.0, 10.0)), lit((0.2, 0.3, 0.35), (0.4, 0.5, 9.6))
    renderer = opened(scene)

    def picture(state: FrameState) -> FloatArray:
        box = PixelBox(0, 0, scene.camera.width_px, scene.camera.height_px)
        light = renderer.render(RenderRequest(state.craft, box, None, seed=0))
        whole = light.coverage[..., None] > 0.999  # a pixel that the plate covers in part is darker
        return np.where(whole, light.radiance_rgb, np.nan).astype(np.float32)

    look = look_at(scene, now, then)
    view, arrays = look.view(), OpticalFlowAnnotator(NoOptions()).annotate(look).arrays
    there = (view.box.pixel_centres_px() + arrays["optical_flow_px"]).astype(np.float32)
    this, following = picture(now)[view.box.slices], picture(then)
    warped = cv2.remap(following, there, None, cv2.INTER_LINEAR, borderValue=(np.nan,) * 3)
    compared = np.isfinite(warped).all(axis=-1) & np.isfinite(this).all(axis=-1) & arrays["flow_visible"]
    assert compared.sum() > 500
    light = np.median(this[compared])
    residual = np.abs(warped - this)[compared] / light
    unwarped = np.abs(following[view.box.slices] - this)[compared] / light
    assert residual.max() < 0.02
    assert np.median(residual) < 0.003
    assert np.nanmedian(unwarped) > 0.1
