"""Users' own joints, by the key ``joints`` of packages and mesh targets, and keypoints on them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import yaml

from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

WING = {"kind": "revolute", "parts": ["wing"], "origin_m": [0, 1, 0], "axis": [0, 2, 0]}
TIP = {"kind": "prismatic", "parts": ["tip*"], "axis": [1, 0, 0], "parent": "wing"}


def build(source, path, **options):
    registry = load_plugins().registry
    return registry.create(
        "scene", source, registry.options("scene", source, {source: str(path), **options})
    ).build()


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """A bus of 2 m, and beside it along Y a wing and two tips, with gaps of a metre."""
    scene = trimesh.Scene()
    for name, y, size in (("bus", 0, 2), ("wing", 3, 2), ("tip_a", 6, 2), ("tip_b", 9, 2)):
        place = trimesh.transformations.translation_matrix((0, y, 0))
        scene.add_geometry(
            trimesh.creation.box((size,) * 3), node_name=name, geom_name=name, transform=place
        )
    path = tmp_path_factory.mktemp("craft") / "craft.glb"
    scene.export(path)
    return path


@pytest.fixture
def package(mesh, tmp_path):
    """Returns a function that makes a package with joints and keypoints."""

    def make(joints, keypoints=None):
        folder = tmp_path / "package"
        folder.mkdir(exist_ok=True)
        (folder / "craft.glb").write_bytes(mesh.read_bytes())
        record = {
            "name": "craft",
            "mesh": "craft.glb",
            "scale_m_per_unit": 1.0,
            "body_axes": "x y z",
            "centre_of_mass_m": [0, 0, 0],
            "keypoints": keypoints or {},
            "joints": joints,
        }
        (folder / "spacecraft.yaml").write_text(yaml.safe_dump(record, sort_keys=False))
        return folder

    return make


def refusal(folder):
    with pytest.raises(InputError) as caught:
        build("package", folder)
    message = str(caught.value)
    assert message.startswith(f"{folder / 'spacecraft.yaml'}: ")
    assert "\n" not in message
    return message


def test_joints_carry_the_parts_that_they_name(package):
    limits = {"limits_deg": [-90, 180], "facing": [0, 0, -3]}
    craft = build(
        "package", package({"tip": TIP, "wing": {**WING, **limits}, "dish": {"kind": "fixed"}})
    )
    assert [joint.name for joint in craft.joints] == ["wing", "tip", "dish"]  # the carrier comes first
    wing, tip, dish = craft.joints
    assert (wing.kind, wing.parent, tip.kind, tip.parent) == ("revolute", None, "prismatic", "wing")
    np.testing.assert_array_equal(wing.axis_body, (0, 1, 0))
    np.testing.assert_array_equal(wing.facing_body, (0, 0, -1))
    np.testing.assert_array_equal(wing.origin_body_m, (0, 1, 0))
    np.testing.assert_allclose(wing.limits, (-np.pi / 2, np.pi))
    assert tip.limits == (-np.inf, np.inf)
    assert dish.kind == "fixed"
    assert {part.name: part.joint for part in craft.parts} == {
        "bus": None,
        "wing": "wing",
        "tip_a": "tip",
        "tip_b": "tip",
    }


def test_a_mesh_target_has_the_same_key(mesh):
    options = {"scale_m_per_unit": 2.0, "centre_of_mass_m": (0, 0, 0)}
    craft = build("mesh", mesh, **options, joints={"wing": {**WING, "limits_deg": [0, 0]}})
    assert [part.joint for part in craft.parts] == [None, "wing", None, None]
    np.testing.assert_array_equal(craft.joints[0].origin_body_m, (0, 1, 0))  # metres, not units
    with pytest.raises(InputError, match=r"craft\.glb: joints\.wing\.parts: no part is named 'wings'"):
        build("mesh", mesh, **options, joints={"wing": {**WING, "parts": ["wings"]}})


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        (
            {"wing": {**WING, "parts": ["wng"]}},
            "joints.wing.parts: no part is named 'wng'; did you mean",
        ),
        ({"wing": {**WING, "parts": ["panel*"]}}, "joints.wing.parts: no part is named 'panel*'"),
        (
            {"wing": WING, "b": {**WING, "parts": ["w*"]}},
            "joints.b.parts: the part 'wing' is carried by",
        ),
        ({"wing": WING, "tip": {**TIP, "parent": "wig"}}, "joints.tip.parent: no joint is named 'wig'"),
        ({"wing": {**WING, "parent": "tip"}, "tip": TIP}, "a circle of joints, wing → tip → wing"),
        ({"wing": {**WING, "parent": "wing"}}, "a circle of joints, wing → wing"),
        ({"wing": {**WING, "axis": [0, 0, 0]}}, "joints.wing.axis: all zero"),
        ({"wing": {**WING, "facing": [0, 0, 0]}}, "joints.wing.facing: all zero"),
        ({"wing": {**WING, "limits_deg": [9, -9]}}, "joints.wing.limits_deg: the first limit is above"),
        ({"wing": {**WING, "limits_m": [0, 1]}}, "limits_m is for prismatic joints"),
        ({"wing": {**WING, "axis": None}}, "joints.wing: a revolute joint needs axis"),
        ({"wing": {**WING, "origin_m": None}}, "joints.wing: a revolute joint needs origin_m"),
        ({"wing": {**WING, "kind": "hinge"}}, "joints.wing.kind: input should be 'revolute', 'pris"),
        ({"wing": {**WING, "centre_m": [0, 0, 0]}}, "joints.wing.centre_m: unknown key"),
        ({"left.wing": WING}, "joints.left.wing: a joint's name has letters, digits, _ and - only"),
    ],
)
def test_faults_of_joints_are_told_in_one_line(package, joints, words):
    assert words in refusal(package(joints))


# Keypoints


def test_keypoints_move_with_the_part_that_they_are_on(package):
    craft = build(
        "package",
        package(
            {"wing": WING, "tip": TIP},
            {
                "B1": {"part": "bus", "corner": [1, 1, 1]},
                "S1": {"part": "wing", "corner": [1, 1, 1]},
                "S2": [0.3, 4, 0.2],  # on the wing's outer face
                "S3": [1, 6.5, 0.5],  # on the first tip
                "B2": [0, 0, 1],
                "B3": [0, 1.5, 0],  # in the gap
                "A1": {"at": [0, 1.5, 0], "joint": "wing"},
                "A2": {"at": [1, 6.5, 0.5], "joint": None},
            },
        ),
    )
    assert craft.keypoint_joints == {"S1": "wing", "S2": "wing", "S3": "tip", "A1": "wing"}
    np.testing.assert_array_equal(craft.keypoints_body_m["A1"], (0, 1.5, 0))
    np.testing.assert_allclose(craft.keypoints_body_m["S1"], (1, 4, 1))


def test_a_keypoint_on_an_unknown_joint_is_refused(package):
    folder = package({"wing": WING}, {"S1": {"at": [0, 3, 1], "joint": "wings"}})
    assert "keypoints.S1.joint: no joint is named 'wings'; did you mean 'wing'?" in refusal(folder)
