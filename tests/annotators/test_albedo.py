"""Base colour per pixel: of materials by part, and of a texture by the point that a pixel shows."""

from dataclasses import replace

import cuboid
import numpy as np
import pytest
from moving_plate import DISTANCE_M, FOCAL_PX, WIDTH, moving, plate
from scipy.spatial.transform import Rotation
from sequences import look_at, posed

from posse_core._annotators.albedo import AlbedoAnnotator
from posse_core._model.camera import Camera
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Material
from posse_core._plugins.options import NoOptions


def albedo(scene, frame):
    """The array over the view's box, and the view."""
    look = look_at(scene, frame, None)
    labels = AlbedoAnnotator(NoOptions()).annotate(look)
    assert not labels.values
    color = labels.arrays["base_color_rgb"]
    assert color.dtype == np.float32
    assert np.isnan(color[~look.view().mask]).all()
    return color, look.view()


@pytest.mark.parametrize("turn", [(0.3, 0.4, 0.5), (-2.0, 1.0, 0.3)])
def test_each_part_has_the_colour_of_its_material(turn):
    craft = cuboid.cuboid()
    colors = np.random.default_rng(1).uniform(size=(6, 3))
    craft = replace(
        craft,
        parts=tuple(replace(part, material=part.name) for part in craft.parts),
        materials={
            part.name: Material(part.name, base_color=tuple(color), metallic=0.5)
            for part, color in zip(craft.parts, colors, strict=True)
        },
    )
    scene = Scene(craft, Camera(40, 30, 40.0, 40.0, 19.5, 14.5, 0.036))
    R = Rotation.from_rotvec(turn).as_matrix()
    color, view = albedo(scene, posed(moving(), R, np.array([0.2, -0.1, 6.0])))
    assert len(np.unique(view.part_id[view.mask])) == 3
    assert np.array_equal(color[view.mask], colors[view.part_id[view.mask]].astype(np.float32))


def test_a_texture_is_read_at_the_point_that_the_pixel_shows():
    """A stripe of black and white texels; row 0 of a texture is at v = 1. Its factor multiplies it."""
    stripes = np.repeat(np.uint8([[[0], [255]]]), 3, axis=2).repeat(8, axis=1)  # left black, right white
    scene = plate()
    part = replace(scene.spacecraft.parts[0], uv=np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]))
    material = Material("grey", base_color=(0.5, 0.25, 1.0), base_color_texture=stripes)
    craft = replace(scene.spacecraft, parts=(part,), materials={"grey": material})
    color, view = albedo(replace(scene, spacecraft=craft), moving())
    column = np.arange(view.box.x0, view.box.x0 + view.box.width)
    x_m = (column - (WIDTH - 1) / 2) * DISTANCE_M / FOCAL_PX
    texel_m = 2 * 2.03 / 16
    row = color[view.box.height // 2]
    # Between the centres of two texels colours are interpolated; the texture repeats.
    black, white = (np.abs(x_m - side * 2.03 / 2) < 2.03 / 2 - texel_m for side in (-1, 1))
    assert black.sum() > 10
    assert white.sum() > 10
    assert (row[black] == 0).all()
    assert (row[white] == np.float32([0.5, 0.25, 1.0])).all()


def test_without_the_spacecraft_there_is_no_colour():
    color, view = albedo(plate(), posed(moving(), np.eye(3), np.array([0, 0, -10.0])))
    assert view.box.is_empty
    assert color.size == 0
