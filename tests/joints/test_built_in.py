"""The joints of the built-in spacecraft: turning one is as building the craft with another angle."""

from __future__ import annotations

import numpy as np
import pytest

from posse_core import Articulation, Spacecraft
from posse_core._plugins.loading import load_plugins
from posse_core._simulator.returned import built
from posse_core._trajectory.joints import with_laws

REGISTRY = load_plugins().registry


def craft(name: str, **options: object) -> Spacecraft:
    return built(REGISTRY.create("scene", name, REGISTRY.options("scene", name, options)), name)


@pytest.mark.parametrize(
    ("name", "angle_deg", "turn_deg"), [("aqua", 0, 50), ("aqua", -25, 170), ("cubesat", 10, 35)]
)
def test_a_wing_turned_by_its_joint_is_a_wing_built_with_the_angle(
    name: str, angle_deg: float, turn_deg: float
) -> None:
    one = craft(name, panel_angle_deg=angle_deg)
    other = craft(name, panel_angle_deg=angle_deg + turn_deg)
    values = np.full(len(one.joints), np.radians(turn_deg))
    posed = Articulation(one.joints, values, np.zeros_like(values))
    for part, expected in zip(one.parts, other.parts, strict=True):
        x_m = posed.in_body(part.vertices_body_m, one.link_of(part.joint), np.zeros(()))
        np.testing.assert_allclose(x_m, expected.vertices_body_m, atol=1e-12)
    for key, point_m in one.keypoints_body_m.items():
        link = one.link_of(one.keypoint_joints.get(key))
        x_m = posed.in_body(point_m, link, np.zeros(()))
        np.testing.assert_allclose(x_m, other.keypoints_body_m[key], atol=1e-12)
    R_body_from_link, _ = posed.poses()
    for number, (joint, same) in enumerate(zip(one.joints, other.joints, strict=True), 1):
        assert joint.facing_body is not None
        assert same.facing_body is not None
        np.testing.assert_allclose(R_body_from_link[number] @ joint.facing_body, same.facing_body)


@pytest.mark.parametrize("name", ["aqua", "cubesat"])
def test_a_joint_faces_where_its_cells_do(name: str) -> None:
    """The back of a panel, which shows the upper half of its texture, is on the other side."""
    whole = craft(name)
    for part in whole.parts:
        if part.material == "solar_panel" and part.joint is not None:
            facing = whole.joints[whole.link_of(part.joint) - 1].facing_body
            backs = part.normals_body[part.uv[:, 1] > 0.6]
            assert len(backs)
            np.testing.assert_allclose(backs @ facing, -1, atol=1e-6)


@pytest.mark.parametrize("name", ["aqua", "cluster", "cubesat"])
def test_without_laws_a_craft_is_rigid(name: str) -> None:
    whole = craft(name)
    welded = with_laws(whole, {})
    assert whole.joints
    assert not welded.joints
    assert not welded.keypoint_joints
    for part, same in zip(whole.parts, welded.parts, strict=True):
        assert same.joint is None
        assert same.vertices_body_m is part.vertices_body_m


def test_a_variant_may_lack_what_hangs_on_a_joint() -> None:
    lost = craft("cubesat", missing_parts=["wing_left"])
    assert {part.name for part in lost.parts if part.joint == "wing_left"} == {"hinges_left"}
    assert "S3" not in lost.keypoint_joints
