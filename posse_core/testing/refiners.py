"""The conformance class for refiners, and the renderer that it draws with."""

from __future__ import annotations

import contextlib
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.refiner import Refinement, Refiner, RefinerSetting
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.craft_state import CraftState
from posse_core._model.scene import Radiance, RenderRequest, Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._plugins.options import NoOptions
from posse_core._randomness import random_generator
from posse_core.testing import scenes
from posse_core.testing.closed_forms import directions
from posse_core.testing.conformance import CHANGED, Conformance

_SUN_CAM = np.array([0.4, -0.5, -0.768114574786861])
_SAMPLES = 3
_NOISE_DN = 1.0
_LIT = 40
"""Numbers above which a pixel of the image is lit, beside a sky of 0 with noise."""
_R_TRUE = Rotation.from_euler("xyz", [20, -35, 15], degrees=True).as_matrix()
_T_TRUE_M = np.array([0.12, -0.08, 6.0])
_TURN_RAD = np.radians([2.0, -2.5, 3.0])
_SHIFT_M = np.array([0.03, 0.02, 0.12])
_MOST_SIGMAS = 6.0
"""How far off the covariance may say that the truth is, in each of six directions together."""


class RefinerConformance(Conformance):
    """What every refiner must do. A subclass provides :meth:`refiner` and ``capabilities``.

    A box with a wing and a mast stands 6 m from a camera of 96 × 72 pixels, in sunlight before a black
    sky. What :attr:`RefinerSetting.renderer` gives draws by casting rays, whatever its name.
    """

    @abstractmethod
    def refiner(self) -> Refiner:
        """A new refiner, not yet open."""

    def test_a_start_nearby_is_brought_closer(self) -> None:
        """From 4.4° and 2 % off: the errors of attitude and position fall to less than half."""
        start = _start()
        with self._opened() as refiner:
            made = refiner.refine(_image(), [start], _SUN_CAM)
        assert made.is_better, "it does not accept a pose that it could find"
        before, after = _errors(start), _errors(made.pose)
        assert after[0] < before[0] / 2, f"the attitude is off by {np.degrees(after[0]):.2f}°"
        assert after[1] < before[1] / 2, f"the position is off by {after[1]:.3f} m"
        assert made.agreement > made.agreement_before, (
            "the agreement did not grow, though the pose is accepted as better"
        )

    def test_the_error_is_as_small_as_the_covariance_says(self) -> None:
        with self._opened() as refiner:
            pose = refiner.refine(_image(), [_start()], _SUN_CAM).pose
        covariance = pose.covariance
        assert covariance.shape == (6, 6), (
            "a covariance is (6, 6): a small rotation in camera axes, then the position"
        )
        np.testing.assert_allclose(
            covariance, covariance.T, rtol=1e-6, atol=1e-15, err_msg="a covariance is symmetric"
        )
        turn = Rotation.from_matrix(_R_TRUE @ pose.R_cam_from_body.T).as_rotvec()
        off = np.concatenate([turn, _T_TRUE_M - pose.t_body_cam_m])
        squared = float(off @ np.linalg.solve(covariance, off))
        assert squared < 6 * _MOST_SIGMAS**2, f"{np.sqrt(squared / 6):.1f} standard deviations off"
        assert np.sqrt(np.diag(covariance))[:3].max() < 1.0, "a covariance of everything says nothing"

    def test_where_nothing_is_seen_the_start_is_returned(self) -> None:
        image = random_generator(0, 1, "refiner-kit").normal(20.0, 3.0, (72, 96))
        start = _start()
        with self._opened() as refiner:
            made = refiner.refine(np.clip(image, 0, 255).astype(np.uint8), [start], _SUN_CAM)
        assert not made.is_better, "it accepts a pose in an image without a spacecraft"
        assert made.certainty_left < 1, "it confirms a start in an image without a spacecraft"
        assert made.pose is start, "it must return the start itself where it finds nothing better"

    def test_of_several_starts_the_right_one_is_taken(self) -> None:
        """Whichever is first: the other is turned by 120° and shows other sides."""
        wrong = replace(
            _start(),
            R_cam_from_body=_R_TRUE @ Rotation.from_euler("y", 120, degrees=True).as_matrix(),
        )
        for starts in ([wrong, _start()], [_start(), wrong]):
            with self._opened() as refiner:
                made = refiner.refine(_image(), starts, _SUN_CAM)
            assert _errors(made.pose)[0] < np.radians(4.0), (
                "of two starts it did not take the one that the image shows; compare them all "
                "before refining"
            )

    def test_the_sun_need_not_be_known(self) -> None:
        with self._opened() as refiner:
            made = refiner.refine(_image(), [_start()])
        _check_form(made)

    def test_the_detected_box_may_be_known(self) -> None:
        """That of what is lit, which is most of what is seen."""
        columns, rows = (np.flatnonzero(np.any(_image() > _LIT, axis=axis)) for axis in (0, 1))
        low = np.array([columns[0], rows[0]])
        box_px = np.concatenate([low, np.array([columns[-1], rows[-1]]) + 1 - low]).astype(np.float64)
        kept = box_px.copy()
        with self._opened() as refiner:
            made = refiner.refine(_image(), [_start()], _SUN_CAM, box_px)
        assert made.is_better, "it does not accept a pose in the box that a detector saw"
        assert _errors(made.pose)[0] < _errors(_start())[0] / 2, "the box keeps it from the pose"
        np.testing.assert_array_equal(box_px, kept, err_msg=CHANGED)

    def test_the_same_image_gives_the_same_bits(self) -> None:
        """Also for a refiner that has refined another image in between."""
        other = replace(_start(), t_body_cam_m=_T_TRUE_M - _SHIFT_M)
        with self._opened() as refiner:
            first = refiner.refine(_image(), [_start()], _SUN_CAM)
            refiner.refine(_image(), [other], _SUN_CAM)
            again = refiner.refine(_image(), [_start()], _SUN_CAM)
        with self._opened() as fresh:
            anew = fresh.refine(_image(), [_start()], _SUN_CAM)
        for made in (again, anew):
            np.testing.assert_array_equal(
                made.pose.R_cam_from_body,
                first.pose.R_cam_from_body,
                err_msg=(
                    "the attitude differs from that of the same image before: does it keep or draw "
                    "something?"
                ),
            )
            np.testing.assert_array_equal(
                made.pose.t_body_cam_m,
                first.pose.t_body_cam_m,
                err_msg=(
                    "the position differs from that of the same image before: does it keep or draw "
                    "something?"
                ),
            )
            np.testing.assert_array_equal(
                made.pose.covariance,
                first.pose.covariance,
                err_msg=(
                    "the covariance differs from that of the same image before: does it keep or "
                    "draw something?"
                ),
            )

    def test_what_it_is_given_is_left_alone(self) -> None:
        image, start, sun = _image(), _start(), _SUN_CAM.copy()
        kept_image, kept_start = image.copy(), deepcopy(start)
        with self._opened() as refiner:
            refiner.refine(image, [start], sun)
        np.testing.assert_array_equal(image, kept_image, err_msg=CHANGED)
        np.testing.assert_array_equal(sun, _SUN_CAM, err_msg=CHANGED)
        np.testing.assert_array_equal(start.R_cam_from_body, kept_start.R_cam_from_body, err_msg=CHANGED)
        np.testing.assert_array_equal(start.t_body_cam_m, kept_start.t_body_cam_m, err_msg=CHANGED)
        np.testing.assert_array_equal(start.covariance, kept_start.covariance, err_msg=CHANGED)

    def test_images_may_be_of_colour_and_of_16_bits(self) -> None:
        grey = _image()
        deep = grey.astype(np.uint16) * 257
        for image in (np.repeat(grey[..., None], 3, axis=-1), deep):
            with self._opened() as refiner:
                made = refiner.refine(image, [_start()], _SUN_CAM)
            assert made.is_better, (
                "it does not accept a pose in an image in colour or of 16 bits; convert it by "
                "posse_core.to_grey"
            )
            assert _errors(made.pose)[0] < _errors(_start())[0] / 2, (
                "the pose of an image in colour or of 16 bits is not closer than the start; "
                "convert it by posse_core.to_grey"
            )

    def test_a_start_out_of_view_is_returned(self) -> None:
        start = replace(_start(), t_body_cam_m=np.array([60.0, 0.0, 6.0]))
        with self._opened() as refiner:
            made = refiner.refine(_image(), [start], _SUN_CAM)
        assert not made.is_better, "it accepts a pose for a start that is out of view"
        assert made.pose is start, "it must return the start itself if it is out of view"

    def test_it_may_be_closed_twice_and_without_open(self) -> None:
        refiner = self.refiner()
        refiner.close()
        refiner.open(_setting())
        refiner.close()
        refiner.close()

    @contextlib.contextmanager
    def _opened(self) -> Iterator[Refiner]:
        refiner = self.refiner()
        refiner.open(_setting())
        try:
            yield refiner
        finally:
            refiner.close()


class RayRenderer(Renderer):
    """Draws Lambert's law by rays through a grid of samples in each pixel; exact edges and shadows."""

    def __init__(self) -> None:
        super().__init__(NoOptions())

    def open(self, scene: Scene) -> None:
        camera = scene.camera
        self._finer = replace(
            camera,
            width_px=_SAMPLES * camera.width_px,
            height_px=_SAMPLES * camera.height_px,
            fx_px=_SAMPLES * camera.fx_px,
            fy_px=_SAMPLES * camera.fy_px,
            cx_px=_SAMPLES * (camera.cx_px + 0.5) - 0.5,
            cy_px=_SAMPLES * (camera.cy_px + 0.5) - 0.5,
        )
        self._caster = RayCaster(scene).through(self._finer)
        self._colours = np.array([piece.material.base_color for piece in scene.pieces])
        self._camera = camera

    def render(self, request: RenderRequest) -> Radiance:
        view, box, craft = self._caster.view(request.craft), request.box, request.craft
        rgb = np.zeros((self._finer.height_px, self._finer.width_px, 3), np.float32)
        covered = np.zeros(rgb.shape[:2], np.float32)
        depth_m = np.full(rgb.shape[:2], np.nan, np.float32)
        if not view.box.is_empty:
            normals_cam = view.normal_cam[view.hit]
            facing = view.lit[view.hit] * np.maximum(normals_cam @ craft.sun_direction_cam, 0)
            light = np.asarray(facing[:, None] * craft.sun_irradiance_rgb_w_m2 / np.pi)
            if request.environment is not None:
                light += _from_sky(normals_cam.astype(np.float32), request.environment.radiance_rgb)
            inside = view.box.slices
            rgb[inside][view.hit] = self._colours[view.part_id[view.hit]] * light
            covered[inside], depth_m[inside] = view.hit, view.depth_m
        middle = depth_m[_SAMPLES // 2 :: _SAMPLES, _SAMPLES // 2 :: _SAMPLES]
        return Radiance(box, _pixels(rgb)[box.slices], _pixels(covered)[box.slices], middle[box.slices])

    def close(self) -> None:
        pass


def _from_sky(normals_cam: Float32Array, radiance_rgb: Float32Array) -> Float32Array:
    """What white, matt surfaces with normals (N, 3) send back of a sky that nothing hides: (N, 3). Of an
    even sky it is the sky's radiance."""
    if np.all(radiance_rgb == radiance_rgb[0, 0]):
        return np.broadcast_to(radiance_rgb[0, 0], normals_cam.shape)
    towards = directions(len(radiance_rgb)).reshape(-1, 3)
    facing = np.maximum(normals_cam @ towards.T.astype(np.float32), 0)
    # Pixels are smaller towards the top and the bottom.
    share = facing * np.hypot(towards[:, 0], towards[:, 2]).astype(np.float32)
    sent = share @ radiance_rgb.reshape(-1, 3) / share.sum(axis=1, keepdims=True)
    return np.asarray(sent, np.float32)


def _pixels(samples: AnyArray) -> AnyArray:
    """Means over the samples of each pixel."""
    height, width = samples.shape[:2]
    size = (width // _SAMPLES, height // _SAMPLES)
    means: AnyArray = np.asarray(cv2.resize(samples, size, interpolation=cv2.INTER_AREA))
    return means


def _setting() -> RefinerSetting:
    return RefinerSetting(_craft(), _camera(), _renderer)


def _renderer(name: str, options: Mapping[str, Any], scene: Scene) -> Renderer:
    """A renderer by rays, whatever is asked for."""
    made = RayRenderer()
    made.open(scene)
    return made


def _camera() -> Camera:
    return scenes.camera(96, 72, np.radians(28))


def _craft() -> Spacecraft:
    """A box with a wing to one side and a mast on another."""
    parts = [
        _cuboid("bus", (-0.5, -0.4, -0.35), (0.5, 0.4, 0.35), "white"),
        _cuboid("wing", (0.5, -0.3, -0.02), (1.3, 0.3, 0.02), "cells"),
        _cuboid("mast", (-0.3, 0.4, -0.05), (-0.2, 0.9, 0.05), "white"),
        _cuboid("patch", (-0.45, -0.35, 0.351), (-0.05, 0.1, 0.353), "cells"),
    ]
    materials = {
        "white": Material("white", (0.8, 0.8, 0.8), specular=0.0),
        "cells": Material("cells", (0.25, 0.25, 0.25), specular=0.0),
    }
    return Spacecraft("kit", tuple(parts), materials)


def _cuboid(name: str, low: tuple[float, ...], high: tuple[float, ...], material: str) -> Part:
    corners: list[FloatArray] = []
    normals, faces = [], []
    ends = np.array([low, high])
    for axis in range(3):
        for side in (0, 1):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corner = np.empty(3)
                corner[axis], corner[a], corner[b] = ends[side, axis], ends[i, a], ends[j, b]
                corners.append(corner)
                normals.append((2 * side - 1) * np.eye(3)[axis])
            first = len(corners) - 4
            order = ((0, 1, 2), (0, 2, 3)) if side else ((0, 2, 1), (0, 3, 2))
            faces += [[first + k for k in triangle] for triangle in order]
    return Part(
        name,
        np.array(corners),
        np.array(faces, np.int32),
        np.array(normals, np.float32),
        np.zeros((len(corners), 2), np.float32),
        material,
    )


def _image() -> AnyArray:
    return _exposed().copy()


@cache
def _exposed() -> AnyArray:
    """(72, 96) uint8, linear: the craft in sunlight and a little light from everywhere, with noise."""
    camera, renderer = _camera(), RayRenderer()
    renderer.open(Scene(_craft(), camera))
    craft = CraftState(
        R_cam_from_body=_R_TRUE,
        t_body_cam_m=_T_TRUE_M,
        sun_direction_cam=_SUN_CAM / np.linalg.norm(_SUN_CAM),
        sun_irradiance_rgb_w_m2=np.full(3, np.pi),
        sun_angular_radius_rad=0.0047,
    )
    everything = PixelBox(0, 0, camera.width_px, camera.height_px)
    light = renderer.render(RenderRequest(craft, everything, None, 0))
    dark = 0.03 * light.coverage
    dn = 230 * (light.radiance_rgb.mean(axis=-1) + dark)
    noise = random_generator(0, 0, "refiner-kit").normal(0.0, _NOISE_DN, dn.shape)
    image: AnyArray = np.clip(np.rint(dn + noise + 2), 0, 255).astype(np.uint8)
    return image


def _start() -> PoseEstimate:
    R = Rotation.from_rotvec(_TURN_RAD).as_matrix() @ _R_TRUE
    sigmas = np.array([*[0.08] * 3, 0.04, 0.04, 0.15])
    return PoseEstimate(R, _T_TRUE_M + _SHIFT_M, np.diag(sigmas**2), np.ones(8, bool), 1.0)


def _errors(pose: PoseEstimate) -> tuple[float, float]:
    """Angle, rad, and distance, m, from the truth."""
    turn = Rotation.from_matrix(_R_TRUE @ pose.R_cam_from_body.T)
    return float(turn.magnitude()), float(np.linalg.norm(pose.t_body_cam_m - _T_TRUE_M))


def _check_form(made: Refinement) -> None:
    pose = made.pose
    assert 0 <= made.agreement <= 1, "agreement is 0 … 1"
    assert 0 <= made.agreement_before <= 1, "agreement_before is 0 … 1"
    np.testing.assert_allclose(
        pose.R_cam_from_body @ pose.R_cam_from_body.T,
        np.eye(3),
        atol=1e-6,
        err_msg=(
            "R_cam_from_body is no rotation; build it from a small rotation vector, not "
            "from sums of matrices"
        ),
    )
    assert np.isfinite(pose.t_body_cam_m).all(), "the position is not finite"
    assert np.isfinite(pose.covariance).all(), "the covariance is not finite"
