"""Joints from the animations of glTF files."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posse_core._errors import InputError
from posse_core._model.joint_curve import JointCurve
from posse_core._model.joints import Articulation
from posse_core._plugins.loading import load_plugins
from posse_core._spacecraft.reader import read_mesh
from tests.support.animated_gltf import AnimatedScene, quaternion, turning

IDENTITY = np.eye(3)


def build(path, **options):
    registry = load_plugins().registry
    raw = {"mesh": str(path), "scale_m_per_unit": 1.0, "centre_of_mass_m": (0.0, 0.0, 0.0), **options}
    return registry.create("scene", "mesh", registry.options("scene", "mesh", raw)).build()


def placed(craft, t_s, animation="move"):
    """Name of a part → its vertices in body axes at a time of an animation."""
    values = [float(joint.animations[animation].at(np.array([t_s]))[0][0]) for joint in craft.joints]
    articulation = Articulation(craft.joints, np.array(values), np.zeros(len(values)))
    return {
        part.name: articulation.in_body(part.vertices_body_m, craft.link_of(part.joint), np.zeros(()))
        for part in craft.parts
    }


def same_points(left, right, tolerance):
    """Whether two sets of points are the same, whatever their order."""
    apart = np.linalg.norm(left[:, None] - right[None], axis=-1)
    return apart.min(axis=1).max() < tolerance and apart.min(axis=0).max() < tolerance


def assert_follows(scene, craft, times_s, animation="move", R=IDENTITY, scale=1.0):
    for t_s in times_s:
        found = placed(craft, t_s, animation)
        for node, record in enumerate(scene.nodes):
            if "mesh" in record:
                wanted = scale * scene.vertices(node, t_s, animation) @ R.T
                assert same_points(found[record["name"]], wanted, 2e-6 * craft.radius_m), (
                    record["name"],
                    t_s,
                )


def box(*size):
    return trimesh.creation.box(size)


# The motion is the file's


@st.composite
def chains(draw):
    """A chain of nodes that turn about their axes or slide along them, by every interpolation, within
    nodes that turn, mirror and scale evenly."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    scene = AnimatedScene()
    above = None
    for k in range(draw(st.integers(1, 4))):
        sign = np.where(rng.random(3) < 0.3, -1.0, 1.0)
        above = scene.add(
            f"frame{k}",
            above,
            translation=rng.uniform(-1, 1, 3),
            rotation=Rotation.random(random_state=rng).as_quat(),
            scale=rng.uniform(0.3, 2.0) * sign,
        )
        rest_t, rest_q = rng.uniform(-1, 1, 3), Rotation.random(random_state=rng).as_quat()
        mesh = box(*rng.uniform(0.2, 1.0, 3))
        above = scene.add(
            f"link{k}",
            above,
            mesh,
            translation=rest_t,
            rotation=rest_q,
            scale=rng.uniform(0.5, 1.5) * np.ones(3),
        )
        paths = draw(st.sampled_from([["rotation"], ["translation"], ["translation", "rotation"]]))
        for path in paths:
            kind = draw(st.sampled_from(["LINEAR", "STEP", "CUBICSPLINE"]))
            count = draw(st.integers(1, 5))
            times_s = np.cumsum(rng.uniform(0.2, 2.0, count))
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
            if path == "translation":
                values = rest_t + rng.uniform(-1, 1, count)[:, None] * axis
                rates = rng.uniform(-1, 1, (2, count))[..., None] * axis
            else:
                values = turning(axis, rng.uniform(-170, 170, count), rest_q)
                values *= np.where(rng.random(count) < 0.5, -1.0, 1.0)[:, None]
                if kind == "CUBICSPLINE":  # tangents of turns about the axis, of any length
                    values = turning(axis, np.cumsum(rng.uniform(-90, 90, count)), rest_q)
                    sides = turning(axis, rng.uniform(-170, 170, 2 * count), rest_q)
                    rates = 0.3 * sides.reshape(2, count, 4)
            if kind == "CUBICSPLINE":
                values = np.stack([rates[0], values, rates[1]], axis=1)
            scene.animate(above, path, times_s, values, kind)
    return scene


@settings(max_examples=40)
@given(scene=chains())
def test_parts_are_where_the_specification_puts_them(tmp_path_factory, scene):
    path = scene.write(tmp_path_factory.mktemp("chain") / "chain.glb")
    craft = build(path)
    assert_follows(scene, craft, np.linspace(-0.5, 10.5, 23))
    if craft.joints:
        zero = Articulation(craft.joints, np.zeros(len(craft.joints)), np.zeros(len(craft.joints)))
        for part in craft.parts:
            at_zero = zero.in_body(part.vertices_body_m, craft.link_of(part.joint), np.zeros(()))
            node = next(k for k, each in enumerate(scene.nodes) if each["name"] == part.name)
            assert same_points(at_zero, scene.vertices(node, None), 2e-6 * craft.radius_m)


def test_parts_follow_with_units_and_axes(tmp_path):
    """The file is in centimetres with Y up, the body in metres with Z up."""
    scene = AnimatedScene()
    slide = scene.add("slide", None, box(10, 20, 30), translation=(100, 0, 50))
    arm = scene.add("arm", slide, box(40, 5, 5), translation=(20, 0, 0))
    scene.animate(slide, "translation", [0, 1], [(100, 0, 50), (100, 30, 90)])
    scene.animate(arm, "rotation", [0, 2], turning((0, 1, 1), [0, 100]))
    scene.write(tmp_path / "a.glb")
    craft = build(tmp_path / "a.glb", scale_m_per_unit=0.01, body_axes="x -z y")
    R = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert_follows(scene, craft, np.linspace(0, 2, 9), R=R, scale=0.01)
    sliding, turning_joint = craft.joints
    assert (sliding.kind, turning_joint.kind) == ("prismatic", "revolute")
    np.testing.assert_allclose(sliding.limits, (0, 0.5), atol=1e-6)  # 30² + 40² = 50² cm
    np.testing.assert_allclose(turning_joint.limits, np.radians((0, 100)), atol=1e-6)
    np.testing.assert_allclose(sliding.axis_body, (0, -0.8, 0.6), atol=1e-6)
    np.testing.assert_allclose(turning_joint.origin_body_m, (1.2, -0.5, 0), atol=1e-6)
    assert turning_joint.parent == "slide"


def test_a_node_that_slides_and_turns_has_two_joints(tmp_path):
    scene = AnimatedScene()
    node = scene.add("claw", None, box(1, 2, 3), translation=(1, 0, 0))
    scene.animate(node, "translation", [0, 1], [(1, 0, 0), (1, 4, 0)])
    scene.animate(node, "rotation", [0, 1], turning((0, 0, 1), [0, 90]))
    scene.write(tmp_path / "a.glb")
    craft = build(tmp_path / "a.glb")
    assert [(j.name, j.kind, j.parent) for j in craft.joints] == [
        ("claw_slide", "prismatic", None),
        ("claw", "revolute", "claw_slide"),
    ]
    assert_follows(scene, craft, np.linspace(0, 1, 7))


def test_each_animation_of_a_file_has_its_name(tmp_path):
    scene = AnimatedScene()
    node = scene.add("door", None, box(1, 2, 3))
    scene.animate(node, "rotation", [0, 1], turning((0, 0, 1), [0, 90]), animation="open")
    scene.animate(node, "rotation", [1, 3], turning((0, 0, 1), [90, -20]), animation="close")
    scene.write(tmp_path / "a.glb")
    craft = build(tmp_path / "a.glb")
    (joint,) = craft.joints
    assert list(joint.animations) == ["open", "close"]
    for animation in joint.animations:
        assert_follows(scene, craft, np.linspace(0, 3, 7), animation)
    np.testing.assert_allclose(joint.limits, np.radians((-20, 90)), atol=1e-6)


def test_where_the_rest_pose_is_not_on_the_way_zero_is_the_first_key(tmp_path):
    scene = AnimatedScene()
    node = scene.add("a", None, box(1, 2, 3), rotation=quaternion((1, 0, 0), 40), translation=(9, 9, 9))
    scene.animate(node, "rotation", [0, 1, 2], turning((0, 0, 1), [10, 60, 20]))
    scene.animate(node, "translation", [0, 1, 2], [(0, 0, 1), (0, 0, 2), (0, 0, 5)])
    scene.write(tmp_path / "a.glb")
    craft = build(tmp_path / "a.glb")
    assert_follows(scene, craft, np.linspace(0, 2, 9))
    (part,) = craft.parts
    assert same_points(part.vertices_body_m, scene.vertices(0, 0.0), 1e-6)


# What is no joint


def hold(scene):
    """A node above that is not animated, and one below that is."""
    above = scene.add("hull", None, box(3, 3, 3))
    return above, scene.add("arm", above, box(1, 2, 3), translation=(1, 2, 3))


CONE = [Rotation.from_euler("xyz", angles).as_quat() for angles in [(0, 0, 0), (1, 0, 0), (1, 1, 0)]]


@pytest.mark.parametrize(
    ("path", "values", "interpolation", "fault"),
    [
        ("rotation", CONE, "LINEAR", "rotation about a varying axis"),
        ("translation", [(1, 2, 3), (2, 2, 3), (2, 3, 3)], "LINEAR", "no straight line"),
        ("scale", [(1, 1, 1), (1, 1, 1), (2, 1, 1)], "STEP", "scale"),
        (
            "translation",  # the keys are on a line, but the tangents lead away from it
            [[(0, 0, 0), (1 + k, 2, 3), (0, 1, 0)] for k in range(3)],
            "CUBICSPLINE",
            "no straight line",
        ),
        (
            "rotation",
            [[(0, 0, 0, 0), quaternion((0, 0, 1), 50 * k), (1, 0, 0, 0)] for k in range(3)],
            "CUBICSPLINE",
            "rotation about a varying axis",
        ),
    ],
)
def test_motion_that_no_joint_has_is_told_and_left_out(tmp_path, path, values, interpolation, fault):
    scene = AnimatedScene()
    _, arm = hold(scene)
    scene.animate(arm, path, [0, 1, 2], values, interpolation)
    scene.write(tmp_path / "a.glb")
    with pytest.warns(UserWarning, match=rf"a\.glb: .*: arm \(.*{fault}\)$"):
        craft = build(tmp_path / "a.glb")
    assert craft.joints == ()
    assert same_points(craft.parts[1].vertices_body_m, scene.vertices(arm, None), 1e-6)


def test_a_faulty_node_still_moves_with_the_node_above_it(tmp_path):
    scene = AnimatedScene()
    hull, arm = hold(scene)
    scene.animate(hull, "rotation", [0, 1], turning((0, 0, 1), [0, 90]))
    scene.animate(arm, "scale", [0, 1], [(1, 1, 1), (2, 2, 2)])
    scene.write(tmp_path / "a.glb")
    with pytest.warns(UserWarning, match=r"arm \(scale\)"):
        craft = build(tmp_path / "a.glb")
    assert [(part.name, part.joint) for part in craft.parts] == [("hull", "hull"), ("arm", "hull")]


def test_a_motion_below_uneven_scale_would_shear_and_is_left_out(tmp_path):
    scene = AnimatedScene()
    above = scene.add("hull", None, scale=(1, 2, 1))
    arm = scene.add("arm", above, box(1, 2, 3))
    scene.animate(arm, "rotation", [0, 1], turning((0, 0, 1), [0, 90]))
    scene.write(tmp_path / "a.glb")
    with pytest.warns(UserWarning, match="uneven scale"):
        craft = build(tmp_path / "a.glb")
    assert craft.joints == ()


def test_channels_that_change_nothing_and_nodes_that_carry_nothing_make_no_joint(tmp_path):
    """Exporters write all three properties of every node that they touch."""
    scene = AnimatedScene()
    hull, arm = hold(scene)
    scene.animate(arm, "translation", [0, 1], [(1, 2, 3)] * 2)
    scene.animate(arm, "rotation", [0, 1], [(0, 0, 0, 1), (0, 0, 0, -1)])
    scene.animate(arm, "scale", [0, 1], [(1, 1, 1)] * 2)
    empty = scene.add("marker", hull)
    scene.animate(empty, "rotation", [0, 1], turning((0, 0, 1), [0, 90]))
    bone = scene.add("bone", hull)
    scene.animate(bone, "rotation", [0, 1, 2], CONE)
    scene.write(tmp_path / "a.glb")
    assert build(tmp_path / "a.glb").joints == ()


def refused(tmp_path, change):
    """The message with which an animated file is refused after a change of its JSON."""
    scene = AnimatedScene()
    node = scene.add("arm", None, box(1, 2, 3))
    scene.animate(node, "rotation", [0, 1, 2], turning((0, 0, 1), [0, 90, 100]))
    path = scene.write(tmp_path / "a.glb", change)
    with pytest.raises(InputError) as caught:
        read_mesh(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def times(header):
    return header["accessors"][header["animations"][0]["samplers"][0]["input"]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda h: times(h).update(count=2), "do not fit its times"),
        (lambda h: times(h).update(byteOffset=4, count=2), "do not fit its times"),
        (lambda h: times(h).update(byteOffset=4), "longer than its buffer view"),
        (lambda h: times(h).update(sparse={}), "sparse"),
        (lambda h: times(h).update(count=-3), "an accessor has -3 values"),
        (lambda h: times(h).update(count=float("inf")), "an accessor has inf values"),
        (lambda h: times(h).update(componentType=5121), "do not increase"),
        (lambda h: times(h).update(componentType=5130), "not a valid .glb file"),
        (lambda h: h["animations"][0]["samplers"][0].update(interpolation="SPLINE"), "'SPLINE'"),
        (lambda h: h["animations"][0]["channels"][0].update(sampler=7), "not a valid .glb file"),
    ],
)
def test_damaged_animations_are_refused_in_one_line(tmp_path, change, words):
    assert words in refused(tmp_path, change)


# Curves


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), is_turn=st.booleans())
def test_extremes_and_rates_of_splines(seed, is_turn):
    rng = np.random.default_rng(seed)
    times_s = np.cumsum(rng.uniform(0.3, 2, 4))
    points, before, after = rng.normal(size=(3, 4)) + 1j * is_turn * rng.normal(size=(3, 4))
    if is_turn:  # away from zero, where the angle is undefined
        points, before, after = points + 4, before, after
    values = 2 * np.angle(points) if is_turn else points.real
    points, before, after = (x if is_turn else x.real for x in (points, before, after))
    curve = JointCurve.spline(times_s, points, before, after, values, float(times_s[-1]))
    t_s = np.linspace(times_s[0] - 0.1, times_s[-1] + 0.1, 20001)
    found, rates = curve.at(t_s)
    step_s = t_s[1] - t_s[0]
    inside = (np.abs(t_s[:, None] - times_s) > 2 * step_s).all(axis=1)
    np.testing.assert_allclose(rates[inside], np.gradient(found, step_s)[inside], atol=2e-3)
    low, high = curve.extremes
    assert low <= found.min() + 1e-12
    assert high >= found.max() - 1e-12
    np.testing.assert_allclose((low, high), (found.min(), found.max()), atol=1e-4)
