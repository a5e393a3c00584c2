"""The robotic arm and the fragments: closed solids, keypoints on them, and where the joints put them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from posse_core._model.joints import Articulation
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.loading import load_plugins


def build(name: str, **options: object) -> Spacecraft:
    registry = load_plugins().registry
    return registry.create("scene", name, registry.options("scene", name, options)).build()


@pytest.mark.parametrize(
    ("name", "options"), [("arm", {}), *(("fragment", {"seed": k}) for k in range(6))]
)
def test_parts_are_closed_and_keypoints_are_on_their_surface(name, options, solid, distance_to_surface):
    craft = build(name, **options)
    for part in craft.parts:
        merged = solid(part.vertices_body_m, part.faces)
        assert merged.is_watertight, part.name
        assert merged.volume > 0.0, part.name
    for keypoint, point in craft.keypoints_body_m.items():
        carried = [part for part in craft.parts if part.joint == craft.keypoint_joints.get(keypoint)]
        distances_m = [distance_to_surface(p.vertices_body_m, p.faces, point) for p in carried]
        assert min(distances_m) < 1e-9, keypoint


@settings(max_examples=50, deadline=None)
@given(st.floats(-3, 3), st.floats(-2, 2), st.floats(-2.5, 2.5), st.floats(-3, 3), st.floats(0, 0.054))
def test_the_gripper_is_where_two_limbs_of_a_plane_arm_put_it(turret, shoulder, elbow, wrist, finger_m):
    arm = build("arm", length_m=1.2)
    names = [joint.name for joint in arm.joints]
    assert names == ["turret", "shoulder", "elbow", "wrist", "finger_left", "finger_right"]
    at = Articulation(arm.joints, np.array([turret, shoulder, elbow, wrist, finger_m, 0.0]), np.zeros(6))
    link = arm.link_of("finger_left")
    point = arm.keypoints_body_m["A2"]
    found = at.in_body(point, link, np.zeros(()))
    # In the plane of the limbs, from the arm's foot: heights along z, and −y to the side it bends to.
    lower = point[2] - 1.2 * 0.55
    closed = np.array([point[0], point[1] - finger_m, 0.0])
    turn = np.cos(wrist), np.sin(wrist)
    x, y = turn[0] * closed[0] - turn[1] * closed[1], turn[1] * closed[0] + turn[0] * closed[1]
    bent = shoulder + elbow
    z = 1.2 * (0.10 + 0.45 * np.cos(shoulder)) + lower * np.cos(bent) + y * np.sin(bent)
    y = -1.2 * 0.45 * np.sin(shoulder) - lower * np.sin(bent) + y * np.cos(bent)
    expected = [
        x * np.cos(turret) - y * np.sin(turret),
        x * np.sin(turret) + y * np.cos(turret),
        z,
    ]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_every_seed_is_another_fragment_of_the_size():
    plates = [build("fragment", seed=k, size_m=0.7).parts[0].vertices_body_m for k in range(12)]
    for plate in plates:
        flat = plate[:, :2]
        assert pdist(flat).max() == pytest.approx(0.7)
    assert len({plate.tobytes() for plate in plates}) == 12
    again = build("fragment", seed=3, size_m=0.7)
    np.testing.assert_array_equal(again.parts[0].vertices_body_m, plates[3])
    finishes = {build("fragment", seed=k).parts[0].material for k in range(30)}
    assert len(finishes) >= 4
