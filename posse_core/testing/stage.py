"""What the conformance tests of renderers share: small scenes, frames and the rendering of images."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._arrays import AnyArray, BoolArray, FloatArray
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.scene import EnvironmentMap, FrameState, Radiance, RenderRequest, Scene
from posse_core._model.spacecraft import Material, Part
from posse_core.testing import scenes
from posse_core.testing.conformance import Conformance

COLOUR = (0.8, 0.5, 0.2)
CLAY = Material("clay", base_color=COLOUR, specular=0.0)
WHITE = Material("white", base_color=(1.0, 1.0, 1.0), specular=0.0)
SIDES = {
    "right": (1.0, 0.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
    "down": (0.0, 1.0, 0.0),
    "up": (0.0, -1.0, 0.0),
}
"""Directions in camera axes."""


@dataclass(frozen=True)
class Stage:
    """An open renderer and the camera of its scene."""

    renderer: Renderer
    camera: Camera

    def shot(
        self,
        frame: FrameState,
        *,
        box: PixelBox | None = None,
        environment: EnvironmentMap | None = None,
        seed: int = 1,
    ) -> Radiance:
        """Render a box (the whole image if None), and check the properties that every image must
        have."""
        requested = box or PixelBox(0, 0, self.camera.width_px, self.camera.height_px)
        image = self.renderer.render(RenderRequest(frame.craft, requested, environment, seed))
        shape = (requested.height, requested.width)
        assert image.box == requested, "it rendered another box than it was asked for"
        assert image.radiance_rgb.shape == (*shape, 3), (
            "radiance_rgb must be (height, width, 3) of the box"
        )
        assert image.coverage.shape == shape, "coverage must be (height, width) of the box"
        assert image.radiance_rgb.dtype == image.coverage.dtype == np.float32, (
            "radiance_rgb and coverage must be float32"
        )
        assert np.isfinite(image.radiance_rgb).all(), (
            "radiance is not finite somewhere: is a root or a logarithm taken of what may "
            "be below zero, or a length divided by?"
        )
        assert image.radiance_rgb.min() >= 0, (
            "radiance is negative somewhere: is it filtered with negative weights, or a "
            "colour converted?"
        )
        assert image.coverage.min() >= 0, (
            "coverage is negative somewhere: is it filtered with negative weights?"
        )
        assert image.coverage.max() <= 1, "coverage exceeds 1 somewhere"
        if image.depth_m is not None:
            assert image.depth_m.shape == shape, "depth_m must be (height, width) of the box"
        return image


class RendererStage(Conformance):
    """Base of the conformance tests of renderers.

    A subclass provides :meth:`renderer`, ``capabilities`` and, if needed, tolerances. A renderer that
    samples should take at least 64 samples per pixel, which the tolerances assume.

    Attributes:
        radiance_tolerance: relative tolerance of Lambertian radiance against E ρ/π cos θ.
        lobe_tolerance: relative tolerance of the light of metal and paint against glTF's model.
        glossy_sky_tolerance: relative tolerance of the sky in rough metal against the integral over its
            lobe.
        edge_tolerance_px: tolerance of the position of a silhouette's edges.
        iou_min: least intersection over union of the pixels with coverage above one half with those of
            the exact ray cast.
    """

    radiance_tolerance: float = 0.01
    lobe_tolerance: float = 0.03
    glossy_sky_tolerance: float = 0.03
    edge_tolerance_px: float = 0.1
    iou_min: float = 0.995

    @abstractmethod
    def renderer(self) -> Renderer:
        """A new renderer, not yet open; its class must be importable."""

    @contextmanager
    def opened(self, scene: Scene) -> Iterator[Stage]:
        """A new renderer, open for the block."""
        renderer = self.renderer()
        renderer.open(scene)
        try:
            yield Stage(renderer, scene.camera)
        finally:
            renderer.close()

    def assert_radiance(self, image: Radiance, expected_rgb: FloatArray) -> None:
        """Check that the spacecraft covers the whole image with the mean radiance ``expected_rgb``
        (3,)."""
        assert (image.coverage > 0.999).all(), (
            "a wall that fills the image does not cover it: is it clipped, culled or seen "
            "from another place?"
        )
        mean = image.radiance_rgb.mean(axis=(0, 1))
        np.testing.assert_allclose(
            mean,
            expected_rgb,
            rtol=self.radiance_tolerance,
            err_msg=(
                "a surface that is lit evenly has another radiance than E ρ/π cos θ: is π "
                "missing, a band exchanged, or a tone curve applied?"
            ),
        )


def one_part(part: Part, *, material: Material, camera: Camera | None = None) -> Scene:
    """A scene of one part."""
    return scenes.scene(part, materials=(material,), camera=camera or scenes.camera())


def wall(material: Material) -> Scene:
    """A plate in the xy plane of the body axes that fills the image of :func:`facing`."""
    plate = scenes.rectangle("wall", material.name, u_m=(9.0, 0, 0), v_m=(0, 9.0, 0))
    return one_part(plate, material=material, camera=scenes.camera(32, 24))


def ball(material: Material = WHITE) -> Scene:
    """A sphere with a radius of 1 m about the origin of the body axes."""
    part = scenes.sphere("ball", material.name, rings=48)
    return one_part(part, material=material, camera=scenes.camera(64, 48))


def craft() -> Scene:
    """A small spacecraft without any symmetry: drum, wing and boom."""
    return scenes.scene(
        scenes.sphere("drum", "white", radius_m=0.6, rings=32),
        scenes.rectangle("wing", "clay", centre_m=(1.3, 0.2, 0), u_m=(0.7, 0.1, 0), v_m=(0, 0.3, 0.2)),
        scenes.rectangle("boom", "clay", centre_m=(0, 1.0, 0.4), u_m=(0.06, 0, 0), v_m=(0, 0.5, 0.2)),
        materials=(WHITE, CLAY),
        camera=scenes.camera(192, 144),
    )


def facing(
    sun: tuple[float, float, float],
    *,
    solar_flux_w_m2: float = scenes.SOLAR_FLUX_W_M2,
    sun_fraction: float = 1.0,
) -> FrameState:
    """A camera 4 m away on the body axis +z that sees +x to the right and +y up; ``sun`` is in body
    axes."""
    return scenes.frame(
        t_body_cam_m=(0.0, 0.0, 4.0),
        sun_direction_body=sun,
        solar_flux_w_m2=solar_flux_w_m2,
        sun_fraction=sun_fraction,
    )


def body(direction_cam: tuple[float, float, float]) -> tuple[float, float, float]:
    """A direction in camera axes → in body axes, for :func:`facing`."""
    x, y, z = scenes.FACING.T @ np.asarray(direction_cam)
    return float(x), float(y), float(z)


def attitudes() -> list[FloatArray]:
    """Three general rotations R_cam_from_body (3, 3)."""
    vectors = ([0.2, -0.3, 0.4], [0.6, 0.5, -2.0], [-0.9, 0.4, 1.3])
    return [Rotation.from_rotvec(vector).as_matrix() @ scenes.FACING for vector in vectors]


def lambert(frame: FrameState, reflectance: tuple[float, float, float], cosine: float) -> FloatArray:
    """(3,) radiance of a Lambertian surface, E ρ/π cos θ."""
    return np.asarray(frame.craft.sun_irradiance_rgb_w_m2 * reflectance / np.pi * cosine)


def project(camera: Camera, frame: FrameState, points_body_m: FloatArray) -> FloatArray:
    """(n, 3) positions in body axes → (n, 2) image positions, px."""
    return camera.project(points_body_m @ frame.craft.R_cam_from_body.T + frame.craft.t_body_cam_m)


def pixels(image: AnyArray) -> FloatArray:
    """(h, w, 2) positions (u, v) of the pixels of an image (h, w)."""
    return PixelBox(0, 0, image.shape[1], image.shape[0]).pixel_centres_px()


def centroid(weight: AnyArray) -> FloatArray:
    """(2,) centroid (u, v) of an image (h, w) of weights, px."""
    w = np.asarray(weight, dtype=np.float64)
    return np.asarray((pixels(w) * w[..., None]).sum(axis=(0, 1)) / w.sum())


def iou(a: BoolArray, b: BoolArray) -> float:
    """Intersection over union."""
    return float((a & b).sum() / (a | b).sum())
