"""The renderers' kit finds renderers that do not move links, bodies, their light or their shadows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.renderer import Renderer
from posse_core._model.craft_state import CraftState
from posse_core._model.scene import Radiance, RenderRequest, Scene
from posse_core._plugins.options import NoOptions
from posse_core.testing import RendererConformance
from posse_core.testing.worlds import WorldsConformance

FINE = 4


class Cast(Renderer[NoOptions]):
    """Lambert's law by ray-casting, with one thing wrong with it."""

    def __init__(self, wrong: str) -> None:
        super().__init__(NoOptions())
        self.wrong = wrong

    def open(self, scene: Scene) -> None:
        if self.wrong == "sticky joints":
            self.stuck: CraftState | None = None
        camera = scene.camera
        fine = replace(
            camera,
            width_px=camera.width_px * FINE,
            height_px=camera.height_px * FINE,
            fx_px=camera.fx_px * FINE,
            fy_px=camera.fy_px * FINE,
            cx_px=(camera.cx_px + 0.5) * FINE - 0.5,
            cy_px=(camera.cy_px + 0.5) * FINE - 0.5,
        )
        self.camera = camera
        colours = [piece.material.base_color for piece in scene.pieces]
        self.colours = np.array([*colours, (0.0, 0.0, 0.0)])
        self.body_of_part = np.append(scene.body_of_part, 0)
        self.caster = RayCaster(replace(scene, camera=fine))
        self.alone = RayCaster(Scene(scene.spacecraft, fine))

    def render(self, request: RenderRequest) -> Radiance:
        craft = seen = request.craft
        articulation = craft.articulation
        at_zero = replace(craft, articulation=replace(articulation, values=0 * articulation.values))
        if self.wrong == "rigid":
            seen = at_zero
        if self.wrong == "sticky joints":
            self.stuck = seen = self.stuck or craft
        if self.wrong == "single precision":
            near = [b.t_body_cam_m - craft.t_body_cam_m for b in craft.others]
            others = [
                replace(b, t_body_cam_m=np.float16(n).astype(float) + craft.t_body_cam_m)
                for b, n in zip(craft.others, near, strict=True)
            ]
            seen = replace(craft, others=tuple(others))
        if self.wrong == "others turned":
            others = [replace(b, R_cam_from_body=craft.R_cam_from_body) for b in craft.others]
            seen = replace(craft, others=tuple(others))
        view = self.caster.view(seen)
        normal, part_id, covered, lit = view.normal_cam, view.part_id, view.hit, view.lit
        if self.wrong == "normals stay":
            normal = np.where(view.hit[..., None], craft.R_cam_from_body[:, 2], np.nan)
        if self.wrong == "others are not lit":
            lit = lit & (self.body_of_part[part_id] == 0)
        if self.wrong == "no shadows":
            lit = np.ones_like(lit)
        if self.wrong == "target in front":
            own = self.alone.view(replace(craft, others=()))
            whole = np.full((self.camera.height_px * FINE, self.camera.width_px * FINE), -1, np.int16)
            whole[view.box.slices] = part_id
            region = whole[own.box.slices]
            region[own.hit] = own.part_id[own.hit]
            part_id = whole[view.box.slices]
        cosine = np.abs(np.nan_to_num(normal) @ craft.sun_direction_cam) * lit
        light = cosine[..., None] * self.colours[part_id] * craft.sun_irradiance_rgb_w_m2 / np.pi
        shape = (self.camera.height_px, self.camera.width_px)
        sums = np.zeros((shape[0] * FINE, shape[1] * FINE, 4))
        sums[view.box.slices] = np.concatenate([light, covered[..., None]], axis=-1)
        mean = sums.reshape(shape[0], FINE, shape[1], FINE, 4).mean(axis=(1, 3)).astype(np.float32)
        image = mean[request.box.slices]
        return Radiance(request.box, image[..., :3], image[..., 3])

    def close(self) -> None:
        pass


TESTS = sorted(name for name in vars(WorldsConformance) if name.startswith("test_"))


class Kit(RendererConformance):
    """The kit on :class:`Cast`, whose samples are few."""

    iou_min = 0.99

    def __init__(self, wrong: str) -> None:
        self.wrong = wrong

    def renderer(self) -> Renderer:
        return Cast(self.wrong)


@pytest.mark.parametrize("test", TESTS)
def test_a_right_renderer_passes(test: str) -> None:
    getattr(Kit("nothing"), test)()


@pytest.mark.parametrize(
    ("wrong", "test"),
    [
        ("rigid", "test_joints_move_what_they_carry"),
        ("sticky joints", "test_joints_leave_nothing_behind"),
        ("normals stay", "test_light_on_a_part_that_turns"),
        ("rigid", "test_the_shadow_of_a_part_that_moves"),
        ("others turned", "test_bodies_are_where_they_are"),
        ("target in front", "test_a_body_hides_what_is_behind_it"),
        ("no shadows", "test_the_shadow_of_one_body_on_another"),
        ("others are not lit", "test_light_on_another_body"),
        ("single precision", "test_edges_of_a_body_near_the_camera_with_a_distant_target"),
    ],
)
def test_a_wrong_renderer_fails(wrong: str, test: str) -> None:
    with pytest.raises(AssertionError):
        getattr(Kit(wrong), test)()
