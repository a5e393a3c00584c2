"""Bodies with joints, and several bodies, against one rigid body whose vertices were moved by scipy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_worlds import part
from scipy.spatial.transform import Rotation

from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import Camera
from posse_core._model.craft_state import BodyState, CraftState, Rates
from posse_core._model.joints import Articulation, Joint
from posse_core._model.scene import Body, Scene
from posse_core._model.spacecraft import Material, Spacecraft

seeds = st.integers(0, 2**32 - 1)
CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5, 0.036)
MATERIALS = {"grey": Material("grey")}


def unit(rng: np.random.Generator) -> np.ndarray:
    x = rng.normal(size=3)
    return x / np.linalg.norm(x)


def arm(rng: np.random.Generator) -> tuple[Spacecraft, Articulation]:
    """A bus with a chain of three joints, one of which slides, and a keypoint on every link."""
    joints = (
        Joint("shoulder", "revolute", rng.normal(size=3), unit(rng)),
        Joint("slide", "prismatic", rng.normal(size=3), unit(rng), "shoulder"),
        Joint("hand", "revolute", rng.normal(size=3), unit(rng), "slide"),
    )
    boxes = [trimesh.creation.box(rng.uniform(0.3, 1.2, 3)) for _ in range(4)]
    for box in boxes:
        box.apply_translation(rng.normal(size=3))
    names = (None, *(joint.name for joint in joints))
    parts = tuple(
        part(f"p{k}", box, name) for k, (box, name) in enumerate(zip(boxes, names, strict=True))
    )
    points = {f"k{k}": box.vertices[0] for k, box in enumerate(boxes)}
    carriers = {f"k{k}": name for k, name in enumerate(names) if name is not None}
    spacecraft = Spacecraft("arm", parts, MATERIALS, points, joints=joints, keypoint_joints=carriers)
    return spacecraft, Articulation(joints, rng.uniform(-2, 2, 3), rng.uniform(-0.5, 0.5, 3))


def baked(spacecraft: Spacecraft, values: np.ndarray) -> Spacecraft:
    """The rigid spacecraft whose vertices and keypoints are where the joints move them."""

    def moved(x: np.ndarray, name: str | None) -> np.ndarray:
        names = [joint.name for joint in spacecraft.joints]
        while name is not None:
            joint, value = spacecraft.joints[names.index(name)], values[names.index(name)]
            if joint.kind == "revolute":
                turn = Rotation.from_rotvec(value * joint.axis_body)
                x = turn.apply(x - joint.origin_body_m) + joint.origin_body_m
            else:
                x = x + value * joint.axis_body
            name = joint.parent
        return x

    return Spacecraft(
        "arm",
        tuple(
            replace(each, vertices_body_m=moved(each.vertices_body_m, each.joint), joint=None)
            for each in spacecraft.parts
        ),
        MATERIALS,
        {
            name: moved(x, spacecraft.keypoint_joints.get(name))
            for name, x in spacecraft.keypoints_body_m.items()
        },
    )


def state(rng: np.random.Generator, articulation: Articulation, **more: object) -> CraftState:
    return CraftState(
        R_cam_from_body=Rotation.random(random_state=rng).as_matrix(),
        t_body_cam_m=np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(6, 9)]),
        rates=Rates(*rng.uniform(-0.2, 0.2, (3, 3))),
        articulation=articulation,
        sun_direction_cam=unit(rng),
        sun_irradiance_rgb_w_m2=np.full(3, 180.0),
        sun_angular_radius_rad=0.00465,
        **more,  # type: ignore[arg-type]
    )


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_joints_move_what_they_carry(seed):
    rng = np.random.default_rng(seed)
    spacecraft, articulation = arm(rng)
    craft = state(rng, articulation)
    view = RayCaster(Scene(spacecraft, CAMERA)).view(craft)
    rigid = RayCaster(Scene(baked(spacecraft, articulation.values), CAMERA)).view(
        replace(craft, articulation=Articulation())
    )
    whole, other = (np.full((120, 160), -2, np.int16) for _ in range(2))
    whole[view.box.slices], other[rigid.box.slices] = view.part_id, rigid.part_id
    assert (np.where(whole == -2, -1, whole) != np.where(other == -2, -1, other)).sum() <= 2
    assert abs(view.silhouette_px - rigid.silhouette_px) <= 2
    np.testing.assert_allclose(view.keypoints_px, rigid.keypoints_px, atol=1e-9)
    np.testing.assert_allclose(view.whole_box_px, rigid.whole_box_px, atol=1e-9)
    if view.box == rigid.box:
        same = view.part_id == rigid.part_id
        np.testing.assert_allclose(view.depth_m[same], rigid.depth_m[same], rtol=1e-6)
        np.testing.assert_allclose(view.normal_cam[same], rigid.normal_cam[same], atol=1e-6)
        assert (view.lit[same] != rigid.lit[same]).mean() < 0.01


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_rays_meet_joints_each_at_its_own_instant(seed):
    """Against the view of the state after that time, whose joints have moved on."""
    rng = np.random.default_rng(seed)
    spacecraft, articulation = arm(rng)
    craft = state(rng, articulation)
    caster = RayCaster(Scene(spacecraft, CAMERA))
    later = caster.view(craft.after(0.7))
    uv = later.box.pixel_centres_px()[later.hit][::7]
    hits = caster.rays(craft, CAMERA.rays(uv), after_s=np.full(len(uv), 0.7))
    part_id, depth_m = later.part_id[later.hit][::7], later.depth_m[later.hit][::7]
    same = hits.part_id == part_id
    assert same.mean() > 0.995
    z_m = hits.distance_m / np.linalg.norm(CAMERA.rays(uv), axis=1)
    np.testing.assert_allclose(z_m[same], depth_m[same], rtol=1e-6)


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_a_link_moves_as_its_motion_says(seed):
    """The velocity field of every link against differences of its points' positions."""
    rng = np.random.default_rng(seed)
    _, articulation = arm(rng)
    craft = state(rng, articulation)
    x = rng.normal(size=(5, 3))
    for link in range(articulation.links):
        step = np.full(5, 1e-5)
        moved = (craft.in_camera(x, step, link) - craft.in_camera(x, -step, link)) / 2e-5
        omega, v = craft.motion(link)
        here = craft.in_camera(x, np.zeros(5), link)
        np.testing.assert_allclose(moved, np.cross(omega, here) + v, atol=1e-7)
        R, t = craft.link_poses_after(link, np.full(5, 0.3))
        poses = craft.after(0.3).link_poses()
        np.testing.assert_allclose(R[0], poses.R_cam_from_link[link], atol=1e-12)
        np.testing.assert_allclose(t[0], poses.t_link_cam_m[link], atol=1e-12)
        np.testing.assert_allclose(
            craft.in_camera(x, np.full(5, 0.3), link), x @ R[0].T + t[0], atol=1e-12
        )


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_several_bodies_hide_and_shade_one_another(seed):
    """Two bodies against one that has the parts of both; each alone against the whole."""
    rng = np.random.default_rng(seed)
    (first, _), (second, _) = arm(rng), arm(rng)
    first, second = first.welded(()), second.welded(())
    craft = state(rng, Articulation())
    R, t = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)
    there = BodyState(craft.R_cam_from_body @ R, craft.R_cam_from_body @ t + craft.t_body_cam_m)
    scene = Scene(first, CAMERA, (Body("second", second),))
    views = RayCaster(scene).views(replace(craft, others=(there,)))
    merged = [
        replace(p, name=f"2{p.name}", vertices_body_m=p.vertices_body_m @ R.T + t) for p in second.parts
    ]
    both = Spacecraft("both", (*first.parts, *merged), MATERIALS, first.keypoints_body_m)
    whole = RayCaster(Scene(both, CAMERA)).view(craft)
    assert views[0].box == whole.box
    inside = views[1].box.within(views[0].box)
    np.testing.assert_array_equal(views[0].hit[inside], views[1].hit)
    assert (views[0].part_id != whole.part_id).sum() <= 2
    same = views[0].part_id == whole.part_id
    assert (views[0].lit[same] != whole.lit[same]).mean() < 0.01
    np.testing.assert_array_equal(views[0].triangle[same], whole.triangle[same])
    mask = np.zeros_like(views[0].mask)
    mask[inside] = views[1].mask
    assert not (views[0].mask & mask).any()
    np.testing.assert_array_equal(views[0].mask | mask, whole.hit)
    parts = len(first.parts)
    np.testing.assert_array_equal(views[1].part_id[views[1].mask] + parts, views[0].part_id[mask])
    alone = RayCaster(Scene(first, CAMERA)).view(craft)
    assert views[0].silhouette_px == alone.silhouette_px
    assert views[0].mask.sum() <= alone.mask.sum()
    hidden = views[0].keypoints_visibility, whole.keypoints_visibility
    assert (hidden[0] != hidden[1]).sum() <= 1  # their tolerances differ with the size of the body


def test_a_body_that_the_chaser_carries_stays_in_its_place():
    rng = np.random.default_rng(3)
    here = BodyState(
        np.eye(3), np.array([0.1, 0.2, 1.0]), Rates(*rng.normal(size=(3, 3))), is_carried=True
    )
    craft = state(rng, Articulation(), others=(here,))
    later = craft.after(2.0)
    np.testing.assert_array_equal(later.others[0].t_body_cam_m, here.t_body_cam_m)
    np.testing.assert_array_equal(later.others[0].R_cam_from_body, np.eye(3))
    assert not np.allclose(later.t_body_cam_m, craft.t_body_cam_m)


def test_what_a_welded_joint_carries_stays_and_turns_with_the_next_one():
    spacecraft, _ = arm(np.random.default_rng(1))
    welded = spacecraft.welded(("shoulder", "hand"))
    assert [joint.name for joint in welded.joints] == ["shoulder", "hand"]
    assert [joint.parent for joint in welded.joints] == [None, "shoulder"]
    assert [each.joint for each in welded.parts] == [None, "shoulder", "shoulder", "hand"]
    assert welded.keypoint_joints == {"k1": "shoulder", "k2": "shoulder", "k3": "hand"}
    assert spacecraft.welded(()).joints == ()
    with pytest.raises(ValueError, match="not in list"):
        welded.link_of("slide")


def test_a_state_of_other_joints_is_refused():
    spacecraft, articulation = arm(np.random.default_rng(1))
    craft = state(np.random.default_rng(2), articulation)
    with pytest.raises(ValueError, match=r"spacecraft\.welded"):
        RayCaster(Scene(spacecraft, CAMERA)).view(replace(craft, articulation=Articulation()))
