"""Where the bodies are: its exact coverage of pixels, and how far a renderer's edges are from it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from posse_core._arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.scene import FrameState, Scene
from posse_core._simulator.light import BOX_MARGIN_PX

FINE = 8
"""Rays across a pixel, and down it, that exact coverage is counted with."""


@dataclass(frozen=True)
class Exact:
    """What geometry says of a frame; arrays cover the box that renderers are asked for.

    Attributes:
        part_id: (h, w) int16 at the pixel's centre, −1 where nothing is.
        depth_m: (h, w) float32 planar z at the pixel's centre, NaN where nothing is.
        coverage: (h, w) share of :data:`FINE`² rays on a lattice that meet a body.
        contour_px: length of the silhouette's contour, px.
    """

    box: PixelBox
    part_id: IntArray
    depth_m: Float32Array
    coverage: FloatArray
    contour_px: float


class Geometry:
    """Exact looks at one scene."""

    def __init__(self, scene: Scene) -> None:
        self._camera = scene.camera
        self._caster = RayCaster(scene)
        self._fine = RayCaster(replace(scene, camera=finer(scene.camera, FINE)))

    def box(self, frame: FrameState) -> PixelBox:
        """What a renderer is asked for; empty where the craft is out of the image."""
        return self._caster.view(frame.craft).box.grown(BOX_MARGIN_PX, self._camera)

    def exact(self, frame: FrameState) -> Exact:
        """The frame in its box, which must not be empty."""
        view = self._caster.view(frame.craft)
        box = view.box.grown(BOX_MARGIN_PX, self._camera)
        fine = self._fine.view(frame.craft)
        fine_box = PixelBox(box.x0 * FINE, box.y0 * FINE, box.width * FINE, box.height * FINE)
        covered = _pasted(fine.hit, fine.box, fine_box, False)
        coverage = covered.reshape(box.height, FINE, box.width, FINE).mean(axis=(1, 3))
        return Exact(
            box=box,
            part_id=_pasted(view.part_id, view.box, box, -1),
            depth_m=_pasted(view.depth_m, view.box, box, np.nan),
            coverage=coverage,
            contour_px=contour_length(covered) / FINE,
        )


def finer(camera: Camera, times: int) -> Camera:
    """The same view with every pixel cut into ``times``² pixels."""
    return replace(
        camera,
        width_px=camera.width_px * times,
        height_px=camera.height_px * times,
        fx_px=camera.fx_px * times,
        fy_px=camera.fy_px * times,
        cx_px=(camera.cx_px + 0.5) * times - 0.5,
        cy_px=(camera.cy_px + 0.5) * times - 0.5,
    )


def iou(a: BoolArray, b: BoolArray) -> float:
    """Intersection over union; 1 where both are empty."""
    union = int((a | b).sum())
    return float((a & b).sum() / union) if union else 1.0


def edge_distance_px(coverage: AnyArray, exact: AnyArray, contour_px: float) -> float:
    """Mean distance between two silhouettes' edges, px, to a fraction of a pixel.

    The area between the two contours over the contour's length. That area is summed as
    Σ |coverage − exact|, so it also holds a renderer's sampling noise, at n independent samples a
    pixel about 0.3/√n px, and the lattice of the exact coverage, about 0.01 px.

    Args:
        coverage, exact: (h, w), 0 … 1.
        contour_px: length of the contour.
    """
    return float(np.abs(np.asarray(coverage, np.float64) - exact).sum() / max(contour_px, 1.0))


def edge_shift_px(coverage: AnyArray, exact: AnyArray) -> FloatArray:
    """(3,) right, down, outward: by how much one silhouette is moved and grown against the other, px.

    Least squares of coverage − exact on the exact coverage's gradient, to first order: a displacement
    d changes it by −∇c·d, a growth g by g |∇c|. Sampling noise averages out; shifts come out up to a
    fifth too large, since differences over two pixels see an edge less steep than it is.
    """
    c = np.pad(np.asarray(exact, np.float64), 1)
    right = np.gradient(c, axis=1)[1:-1, 1:-1].ravel()
    down = np.gradient(c, axis=0)[1:-1, 1:-1].ravel()
    columns = np.stack([-right, -down, np.hypot(right, down)], axis=-1)
    change = (np.asarray(coverage, np.float64) - exact).ravel()
    return np.asarray(np.linalg.lstsq(columns, change, rcond=None)[0])


def contour_length(mask: BoolArray) -> float:
    """Length of a mask's contour in its pixels, by counting crossings along lines in four directions.

    Cauchy-Crofton, as in Serra, Image Analysis and Mathematical Morphology (1982): right for a curve
    that takes every direction, within 6 % for a straight line in any. The image's border is no contour.
    """
    m = mask
    straight = (m[:, 1:] != m[:, :-1]).sum() + (m[1:] != m[:-1]).sum()
    diagonal = (m[1:, 1:] != m[:-1, :-1]).sum() + (m[1:, :-1] != m[:-1, 1:]).sum()
    return float(np.pi / 8 * (straight + diagonal / np.sqrt(2)))


def landmark_errors_px(coverage: AnyArray, exact: Exact, centroids_px: FloatArray) -> FloatArray:
    """(K,) distance of the centroid of each part's coverage from where it should be, px.

    Args:
        coverage: (h, w) in the exact view's box.
        centroids_px: (K, 2) in the parts' order.
    """
    u, v = np.moveaxis(exact.box.pixel_centres_px(), -1, 0)
    errors = []
    for part, expected_px in enumerate(centroids_px):
        near = cv2.dilate((exact.part_id == part).astype(np.uint8), np.ones((5, 5), np.uint8))
        weight = np.where(near > 0, coverage, 0.0).astype(np.float64)
        found = np.array([(u * weight).sum(), (v * weight).sum()]) / max(float(weight.sum()), 1e-12)
        errors.append(np.linalg.norm(found - expected_px))
    return np.array(errors)


def _pasted(array: AnyArray, box: PixelBox, into: PixelBox, fill: float | bool) -> AnyArray:
    """The array of ``box`` in the larger box ``into``."""
    out = np.full((into.height, into.width), fill, dtype=array.dtype)
    y, x = box.y0 - into.y0, box.x0 - into.x0
    out[y : y + box.height, x : x + box.width] = array
    return out
