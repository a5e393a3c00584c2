"""Conformance of renderers: parts that joints move, and several bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._arrays import AnyArray, FloatArray
from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import Camera
from posse_core._model.craft_state import BodyState, CraftState
from posse_core._model.joints import RIGID, Articulation, Joint
from posse_core._model.scene import FrameState, Radiance, Scene
from posse_core._model.spacecraft import Material, Part
from posse_core.testing import scenes
from posse_core.testing.closed_forms import polygon_area_and_centroid
from posse_core.testing.stage import (
    CLAY,
    COLOUR,
    WHITE,
    RendererStage,
    attitudes,
    centroid,
    craft,
    iou,
    lambert,
    pixels,
    project,
)

_SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
_SHOULDER = Joint("shoulder", "revolute", np.array([0.6, 0.2, 0.0]), np.array([1.0, 0.0, 0.0]))
_SLIDE = Joint("slide", "prismatic", np.zeros(3), np.array([0.0, 1.0, 0.0]), "shoulder")
_VALUES = ((0.0, 0.0), (1.1, 0.3), (-2.3, -0.4))
"""Of the two joints, rad and m."""


class WorldsConformance(RendererStage):
    """A renderer draws ``scene.pieces``, each at the pose of its link, and light goes between all of
    them."""

    def test_joints_move_what_they_carry(self) -> None:
        """Silhouette and depth of a craft whose wing turns, and whose boom slides on the wing, against
        the exact ray cast."""
        scene = _arm()
        caster = RayCaster(scene)
        with self.opened(scene) as stage:
            for values, R in zip(_VALUES, attitudes(), strict=True):
                frame = _arm_frame(values, R)
                image, view = stage.shot(frame), caster.view(frame.craft)
                self._assert_silhouette(image, scene, frame.craft, caster, f"joints at {values}")
                if image.depth_m is not None:
                    inside = view.hit & (image.coverage[view.box.slices] == 1)
                    error_m = np.abs(image.depth_m[view.box.slices] - view.depth_m)[inside]
                    assert np.mean(error_m < 0.01) > 0.98, "the depth of a moved part is wrong"

    def test_joints_leave_nothing_behind(self) -> None:
        """The joints go back to zero, and the image is that of a new renderer."""
        scene = _arm()
        with self.opened(scene) as stage:
            for values in _VALUES[1:]:
                stage.shot(_arm_frame(values, attitudes()[0]))
            after = stage.shot(_arm_frame((0.0, 0.0), attitudes()[0]))
        with self.opened(scene) as stage:
            fresh = stage.shot(_arm_frame((0.0, 0.0), attitudes()[0]))
        np.testing.assert_allclose(
            after.coverage,
            fresh.coverage,
            atol=0.25,
            err_msg=(
                "coverage is not that of a new renderer after joints went back to zero: is a "
                "link's transform kept or added?"
            ),
        )
        np.testing.assert_allclose(
            after.radiance_rgb.sum(),
            fresh.radiance_rgb.sum(),
            rtol=0.02,
            err_msg=(
                "radiance is not that of a new renderer after joints went back to zero: is a "
                "shadow or a normal kept?"
            ),
        )

    def test_light_on_a_part_that_turns(self) -> None:
        """E ρ/π cos θ on a plate that a joint turns away from the Sun: its normals turn with it."""
        joint = Joint("hinge", "revolute", np.zeros(3), np.array([0.0, 1.0, 0.0]))
        plate = scenes.rectangle("plate", "clay", u_m=(9.0, 0, 0), v_m=(0, 9.0, 0))
        scene = scenes.scene(
            replace(plate, joint="hinge"),
            materials=(CLAY,),
            camera=scenes.camera(32, 24),
            joints=(joint,),
        )
        with self.opened(scene) as stage:
            for angle in (0.0, 0.5, -0.8):
                turned = Articulation((joint,), np.array([angle]), np.zeros(1))
                frame = scenes.frame(
                    t_body_cam_m=(0.0, 0.0, 4.0), sun_direction_body=(0, 0, 1), articulation=turned
                )
                self.assert_radiance(stage.shot(frame), lambert(frame, COLOUR, np.cos(angle)))

    def test_the_shadow_of_a_part_that_moves(self) -> None:
        """A plate that a joint slides aside casts its shadow where it then is."""
        joint = Joint("slide", "prismatic", np.zeros(3), np.array([1.0, 0.0, 0.0]))
        plate = scenes.rectangle(
            "plate", "white", centre_m=(0.0, 0.2, 0.5), u_m=(0.15, 0, 0), v_m=(0, 0.1, 0)
        )
        scene = scenes.scene(
            _wall(),
            replace(plate, joint="slide"),
            materials=(WHITE,),
            camera=scenes.camera(),
            joints=(joint,),
        )
        with self.opened(scene) as stage:
            for value in (0.3, 0.1):
                moved = Articulation((joint,), np.array([value]), np.zeros(1))
                frame = _lit_aside(articulation=moved)
                _assert_shadow(stage.shot(frame), scene, frame, (value, 0.2, 0.5))

    def test_bodies_are_where_they_are(self) -> None:
        """The silhouette of three bodies together against the exact ray cast, in three places each."""
        scene = scenes.scene(
            *craft().spacecraft.parts,
            materials=(WHITE, CLAY),
            camera=scenes.camera(192, 144),
            others=(
                scenes.sphere("ball", "clay", radius_m=0.5, rings=24),
                scenes.rectangle("sheet", "white", u_m=(0.4, 0.1, 0), v_m=(0, 0.3, 0.2)),
            ),
        )
        caster = RayCaster(scene)
        places = ([0.9, 0.6, 4.0], [-1.0, 0.4, 7.0], [-0.3, -0.8, 3.0])
        with self.opened(scene) as stage:
            for number, R in enumerate(attitudes()):
                others = tuple(
                    BodyState(attitudes()[number - k], np.array(places[number - k])) for k in (1, 2)
                )
                frame = scenes.frame(
                    t_body_cam_m=(0.1, -0.1, 5.0),
                    sun_direction_body=(0, 0, 1),
                    R_cam_from_body=R,
                    others=others,
                )
                image = stage.shot(frame)
                self._assert_silhouette(image, scene, frame.craft, caster, f"bodies, frame {number}")

    def test_a_body_hides_what_is_behind_it(self) -> None:
        """A blue square before a red one of the target, and then behind it: the light of each by the
        area that it shows."""
        red, blue = (
            Material(n, base_color=c, specular=0.0)
            for n, c in (("red", (1.0, 0.0, 0.0)), ("blue", (0.0, 0.0, 1.0)))
        )
        scene = scenes.scene(
            scenes.rectangle("target", "red", u_m=(0.5, 0, 0), v_m=(0, 0.5, 0)),
            materials=(red, blue),
            camera=scenes.camera(),
            others=(scenes.rectangle("other", "blue", u_m=(0.5, 0, 0), v_m=(0, 0.5, 0)),),
        )
        with self.opened(scene) as stage:
            for z_m in (3.0, 5.0):
                there = BodyState(scenes.FACING, np.array([0.0, 0.0, z_m]))
                frame = scenes.frame(
                    t_body_cam_m=(0.0, 0.0, 4.0), sun_direction_body=(0, 0, 1), others=(there,)
                )
                image = stage.shot(frame)
                near, far = sorted(((4.0, 0), (z_m, 2)))
                light = image.radiance_rgb.sum(axis=(0, 1)) * np.pi
                sides_px = scene.camera.fx_px / near[0]
                expected = sides_px**2 * frame.craft.sun_irradiance_rgb_w_m2[near[1]]
                np.testing.assert_allclose(
                    light[near[1]], expected, rtol=0.03, err_msg="the nearer body is not whole"
                )
                assert light[far[1]] < 0.02 * expected, "the body behind shines through the other"

    def test_the_shadow_of_one_body_on_another(self) -> None:
        """A body that is turned about the line of sight casts its shadow on the target, beside it."""
        plate = scenes.rectangle("plate", "white", u_m=(0, 0.15, 0), v_m=(-0.1, 0, 0))
        scene = scenes.scene(_wall(), materials=(WHITE,), camera=scenes.camera(), others=(plate,))
        quarter_turn = scenes.FACING @ Rotation.from_rotvec([0.0, 0.0, np.pi / 2]).as_matrix()
        with self.opened(scene) as stage:
            for x_m in (0.3, 0.1):
                place = np.array([x_m, 0.2, 0.5])
                there = BodyState(quarter_turn, scenes.FACING @ place + [0.0, 0.0, 4.0])
                frame = _lit_aside(others=(there,))
                _assert_shadow(stage.shot(frame), scene, frame, (x_m, 0.2, 0.5))

    def test_light_on_another_body(self) -> None:
        """E ρ/π cos θ on a body beside the target, which is out of view and has another attitude."""
        scene = scenes.scene(
            scenes.sphere("ball", "clay", rings=12),
            materials=(CLAY,),
            camera=scenes.camera(32, 24),
            others=(scenes.rectangle("wall", "clay", u_m=(9.0, 0, 0), v_m=(0, 9.0, 0)),),
        )
        with self.opened(scene) as stage:
            for angle in (0.0, 0.6):
                R = scenes.FACING @ Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix()
                frame = scenes.frame(
                    t_body_cam_m=(40.0, 0.0, -20.0),
                    sun_direction_body=(0, 0, 1),
                    others=(BodyState(R, np.array([0.0, 0.0, 4.0])),),
                )
                self.assert_radiance(stage.shot(frame), lambert(frame, COLOUR, np.cos(angle)))

    def test_edges_of_a_body_near_the_camera_with_a_distant_target(self) -> None:
        """Area and centroid of a plate three metres away, with the target three kilometres away: single
        precision about the target would displace it."""
        plate = scenes.rectangle("plate", "clay", u_m=(0.6, 0, 0), v_m=(0, 0.4, 0))
        camera = replace(scenes.camera(), cx_px=40.3, cy_px=38.9)
        scene = scenes.scene(
            scenes.sphere("ball", "clay", rings=12), materials=(CLAY,), camera=camera, others=(plate,)
        )
        with self.opened(scene) as stage:
            for R in attitudes():
                there = BodyState(R, np.array([0.2, -0.1, 3.0]))
                frame = scenes.frame(
                    t_body_cam_m=(1200.0, 1000.0, 3000.0), sun_direction_body=(0, 0, 1), others=(there,)
                )
                self._assert_plate(stage.shot(frame), camera, plate, there)

    def _assert_plate(self, image: Radiance, camera: Camera, plate: Part, there: BodyState) -> None:
        """Check the area and the centroid of the coverage by one plate."""
        corners = camera.project(plate.vertices_body_m @ there.R_cam_from_body.T + there.t_body_cam_m)
        area, middle = polygon_area_and_centroid(corners)
        perimeter = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=-1).sum()
        assert abs(image.coverage.sum() - area) < self.edge_tolerance_px * perimeter, (
            "the plate covers another area: is the scene in single precision about a distant target?"
        )
        np.testing.assert_allclose(
            centroid(image.coverage),
            middle,
            atol=self.edge_tolerance_px,
            err_msg=(
                "the plate is elsewhere than its projection: is the scene in single precision "
                "about a distant target?"
            ),
        )

    def _assert_silhouette(
        self, image: Radiance, scene: Scene, state: CraftState, caster: RayCaster, which: str
    ) -> None:
        """Check the silhouette of all bodies together."""
        view = caster.view(state)
        exact = np.zeros((scene.camera.height_px, scene.camera.width_px), dtype=bool)
        exact[view.box.slices] = view.hit
        same = iou(image.coverage > 0.5, exact)
        assert same >= self.iou_min, f"{which}: IoU of the silhouette with the exact one is {same:.3f}"


def _arm() -> Scene:
    """The small spacecraft of the other tests, with a wing that turns and a boom that slides on it."""
    drum, wing, boom = craft().spacecraft.parts
    return scenes.scene(
        drum,
        replace(wing, joint="shoulder"),
        replace(boom, joint="slide"),
        materials=(WHITE, CLAY),
        camera=scenes.camera(192, 144),
        joints=(_SHOULDER, _SLIDE),
    )


def _arm_frame(values: tuple[float, float], R_cam_from_body: FloatArray) -> FrameState:
    return scenes.frame(
        t_body_cam_m=(0.1, -0.1, 5.0),
        sun_direction_body=(0, 0, 1),
        R_cam_from_body=R_cam_from_body,
        articulation=Articulation((_SHOULDER, _SLIDE), np.array(values), np.zeros(2)),
    )


def _wall() -> Part:
    return scenes.rectangle("wall", "white", u_m=(9.0, 0, 0), v_m=(0, 9.0, 0))


def _lit_aside(articulation: Articulation = RIGID, others: tuple[BodyState, ...] = ()) -> FrameState:
    """As :func:`facing`, with the Sun aside."""
    return scenes.frame(
        t_body_cam_m=(0.0, 0.0, 4.0),
        sun_direction_body=(1.0, 0.5, 1.0),
        articulation=articulation,
        others=others,
    )


def _assert_shadow(
    image: Radiance, scene: Scene, frame: FrameState, plate_m: tuple[float, float, float]
) -> None:
    """Check the shadow of a plate of 0.3 m × 0.2 m at a place, body axes, on the wall at z = 0."""
    light = image.radiance_rgb.mean(axis=-1)
    sun = frame.craft.sun_direction_body
    shadow_m = np.array(plate_m) - plate_m[2] * sun / sun[2]
    corners = project(scene.camera, frame, shadow_m + [0.15, 0.1, 0] * _SQUARE)
    area, middle = polygon_area_and_centroid(corners)
    near = np.hypot(*(np.moveaxis(pixels(light), -1, 0) - middle[:, None, None])) < 9
    darkness: AnyArray = np.where(near, 1 - light / np.median(light), 0)
    assert darkness.sum() > 0.5 * area, "there is no shadow where it should be"
    np.testing.assert_allclose(
        centroid(darkness),
        middle,
        atol=0.3,
        err_msg=(
            "the shadow is not where it should be: is it that of where the part was built, "
            "or of another body?"
        ),
    )
    np.testing.assert_allclose(
        darkness.sum(), area, rtol=0.1, err_msg="the shadow is not as large or as dark as it should be"
    )
