"""Conformance of renderers: the spacecraft's geometry in the image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import PixelBox
from posse_core._model.spacecraft import Material
from posse_core.testing import scenes
from posse_core.testing.closed_forms import polygon_area_and_centroid
from posse_core.testing.stage import (
    CLAY,
    WHITE,
    RendererStage,
    attitudes,
    ball,
    centroid,
    craft,
    facing,
    iou,
    lambert,
    one_part,
    pixels,
    project,
)


class GeometryConformance(RendererStage):
    """Silhouettes, edges, axes, boxes, coverage, depth."""

    def test_silhouette_is_the_ray_casts(self) -> None:
        scene = craft()
        caster = RayCaster(scene)
        with self.opened(scene) as stage:
            for R in attitudes():
                frame = scenes.frame(
                    t_body_cam_m=(0.1, -0.1, 5.0), sun_direction_body=(0, 0, 1), R_cam_from_body=R
                )
                view = caster.view(frame.craft)
                exact = np.zeros((scene.camera.height_px, scene.camera.width_px), dtype=bool)
                exact[view.box.slices] = view.mask
                assert iou(stage.shot(frame).coverage > 0.5, exact) >= self.iou_min, (
                    "the silhouette is not that of the exact ray cast; are pose, intrinsics and the "
                    "centre of the first pixel at (0, 0) POSSE's?"
                )

    def test_edges_are_where_the_pinhole_puts_them(self) -> None:
        """Area and centroid of the coverage of a small plate, in several attitudes, off the image's
        centre."""
        plate = scenes.rectangle("plate", "clay", u_m=(0.6, 0, 0), v_m=(0, 0.4, 0))
        camera = replace(scenes.camera(), cx_px=40.3, cy_px=38.9)
        scene = one_part(plate, material=CLAY, camera=camera)
        with self.opened(scene) as stage:
            for R in attitudes():
                frame = scenes.frame(
                    t_body_cam_m=(0.2, -0.1, 3.0), sun_direction_body=(0, 0, 1), R_cam_from_body=R
                )
                coverage = stage.shot(frame).coverage
                corners = project(camera, frame, plate.vertices_body_m)
                area, middle = polygon_area_and_centroid(corners)
                perimeter = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=-1).sum()
                assert abs(coverage.sum() - area) < self.edge_tolerance_px * perimeter, (
                    "a plate covers another area than its projection; are pixels counted whole, or "
                    "scaled?"
                )
                np.testing.assert_allclose(
                    centroid(coverage),
                    middle,
                    atol=self.edge_tolerance_px,
                    err_msg=(
                        "a plate is not where its projection is; half a pixel is often the pixel's "
                        "corner taken for its centre"
                    ),
                )

    def test_axes_of_the_pose(self) -> None:
        """Balls on the body axes +x, +y and +z, each of one primary colour, have the right positions."""
        colours = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
        parts, materials = [], []
        for axis, (name, colour) in enumerate(colours.items()):
            centre = np.eye(3)[axis] * 0.8
            parts.append(scenes.sphere(name, name, centre_m=tuple(centre), radius_m=0.2, rings=24))
            materials.append(Material(name, base_color=colour, specular=0.0))
        scene = scenes.scene(*parts, materials=tuple(materials), camera=scenes.camera())
        with self.opened(scene) as stage:
            for R in attitudes():
                frame = scenes.frame(
                    t_body_cam_m=(0.3, 0.2, 6.0), sun_direction_body=tuple(-R[2]), R_cam_from_body=R
                )
                image = stage.shot(frame)
                expected = project(scene.camera, frame, 0.8 * np.eye(3))
                for band in range(3):
                    found = centroid(image.radiance_rgb[..., band])
                    np.testing.assert_allclose(
                        found,
                        expected[band],
                        atol=0.6,
                        err_msg=(
                            "a ball on a body axis is elsewhere, or of another colour: is the pose "
                            "body to camera, and the order of bands red, green, blue?"
                        ),
                    )

    def test_a_box_is_the_slice_of_a_larger_one(self) -> None:
        scene = ball()
        with self.opened(scene) as stage:
            frame = facing(sun=(1.0, 0.5, 1.0))
            whole = stage.shot(frame)
            height, width = whole.coverage.shape
            for box in (
                PixelBox(0, 0, width // 2, height // 2),
                PixelBox(21, 13, 23, 30),
                PixelBox(width - 29, height - 23, 29, 23),
                PixelBox(width // 2, height // 2, 1, 1),
            ):
                part = stage.shot(frame, box=box)
                assert part.box == box, "it rendered another box than it was asked for"
                np.testing.assert_allclose(
                    part.coverage,
                    whole.coverage[box.slices],
                    atol=0.25,
                    err_msg=(
                        "coverage in a box is not that of the whole image there; is the box shifted, or "
                        "are samples placed by the box?"
                    ),
                )
                full = (part.coverage == 1) & (whole.coverage[box.slices] == 1)
                np.testing.assert_allclose(
                    part.radiance_rgb[full].sum(axis=0),
                    whole.radiance_rgb[box.slices][full].sum(axis=0),
                    rtol=0.02,
                    err_msg=(
                        "radiance in a box is not that of the whole image there; does light depend on "
                        "the box?"
                    ),
                )

    def test_coverage_and_radiance_agree(self) -> None:
        """Radiance is averaged over the pixel, whose uncovered part is black, so it scales with
        coverage."""
        plate = scenes.rectangle("plate", "white", u_m=(0.7, 0.1, 0), v_m=(-0.1, 0.7, 0))
        with self.opened(one_part(plate, material=WHITE)) as stage:
            frame = facing(sun=(0.0, 0.0, 1.0))
            image = stage.shot(frame)
        full = lambert(frame, WHITE.base_color, 1.0)
        partial = (image.coverage > 0.05) & (image.coverage < 0.95)
        assert partial.sum() > 50, "hardly any pixel is partly covered: edges have no sub-pixel samples"
        share = image.radiance_rgb[partial] / full
        np.testing.assert_allclose(
            share,
            np.stack([image.coverage[partial]] * 3, -1),
            atol=0.02,
            err_msg=(
                "radiance does not scale with coverage: it must be averaged over the pixel with "
                "black where nothing is, not divided by coverage"
            ),
        )
        assert image.radiance_rgb[image.coverage == 0].max() == 0.0, (
            "there is light where nothing is covered: is a background or the sky in the image?"
        )

    def test_depth(self) -> None:
        """Planar depth at the pixel's centre, if the renderer provides it."""
        plate = scenes.rectangle("plate", "white", u_m=(0.7, 0, 0.3), v_m=(0, 0.7, 0.1))
        with self.opened(one_part(plate, material=WHITE)) as stage:
            frame = facing(sun=(0.0, 0.0, 1.0))
            image = stage.shot(frame)
        if image.depth_m is None:
            return
        rays = scenes.camera().rays(pixels(image.coverage))
        normal = frame.craft.R_cam_from_body @ np.cross([0.7, 0, 0.3], [0, 0.7, 0.1])
        z_m = (normal @ frame.craft.t_body_cam_m) / (rays @ normal)
        full = image.coverage > 0.999
        np.testing.assert_allclose(
            image.depth_m[full],
            z_m[full],
            atol=1e-3,
            err_msg=(
                "depth is not planar z at the pixel's centre: is it the ray's length, or an "
                "average over the pixel?"
            ),
        )
        assert np.isnan(image.depth_m[image.coverage == 0]).all(), "depth must be NaN where nothing is"
