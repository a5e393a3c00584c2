"""The law bending against a beam of finite elements, and keys that are patterns."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from posse_core import InputError
from posse_core._plugins.loading import Plugins
from posse_core._scenario.load import load_scenario
from posse_core._simulator.simulator import Simulator

FLAT = Path(__file__).parents[1] / "packages" / "flat"
LAW = {"law": "bending", "amplitude_m": 0.2, "frequency_hz": 0.5}


@pytest.fixture(scope="module")
def registry():
    """With a renderer that is quick."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(FLAT)
        yield Plugins([EntryPoint("render_flat", "posse_flat", "posse")]).registry


def simulator(registry, joints, seed=15):
    changes = {
        "target": {"name": "family", "seed": seed},
        "joints": joints,
        "renderer": {"name": "flat"},
        "annotators": ["pose"],
        "camera": {"width_px": 32, "height_px": 24},
        "sky": {"earth": False},
    }
    return Simulator(load_scenario("aqua", registry, changes), registry)


@pytest.fixture(scope="module")
def wings(registry):
    with simulator(registry, {"wing_*_hinge_*": LAW}) as opened:
        yield opened


def beams_first_mode(shares):
    """Deflections of a clamped uniform beam's first mode, 1 at the tip, by 200 Hermite elements."""
    count = 200
    h = 1.0 / count
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]])
    k = np.vstack([k, -k[0], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]) / h**3
    m = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h]])
    m = np.vstack([m, [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]) * h / 420
    K, M = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for element in range(count):
        span = slice(2 * element, 2 * element + 4)
        K[span, span] += k
        M[span, span] += m
    square, modes = eigh(K[2:, 2:], M[2:, 2:], subset_by_index=[0, 0])
    assert np.sqrt(square[0]) == pytest.approx(1.875104**2, rel=1e-4)
    nodes = np.concatenate([[0.0], modes[::2, 0]])
    return np.interp(shares, np.linspace(0.0, 1.0, count + 1), nodes / nodes[-1])


def hinges_of(craft, wing):
    return [joint for joint in craft.joints if joint.name.startswith(f"{wing}_hinge")]


@pytest.mark.parametrize("t_s", [0.0, 0.4, 1.3])
@pytest.mark.parametrize("wing", ["wing_1", "wing_2"])
def test_hinges_and_tip_are_on_the_bent_beam(wings, wing, t_s):
    """The deflection across the wing, measured at the panels, is the beam's times a cosine in time."""
    craft = wings.spacecraft
    articulation = wings.state(0, t_s=t_s).craft.articulation
    hinges = hinges_of(craft, wing)
    assert len(hinges) >= 3
    panels = {part.joint: part for part in craft.parts if "_panel_" in part.name}
    along = hinges[1].origin_body_m - hinges[0].origin_body_m
    along /= np.linalg.norm(along)
    normal = np.cross(hinges[0].axis_body, along)
    root_m = hinges[0].origin_body_m
    tip_m = panels[hinges[-1].name].vertices_body_m
    tip_m = tip_m[(tip_m @ along) > (tip_m @ along).max() - 1e-9].mean(axis=0)
    points_m = [*(joint.origin_body_m for joint in hinges[1:]), tip_m]
    links = [craft.link_of(joint.name) for joint in hinges]
    bent_m = [
        articulation.in_body(x, link, np.zeros(())) for x, link in zip(points_m, links, strict=True)
    ]
    length_m = (tip_m - root_m) @ along
    shares = [(x - root_m) @ along / length_m for x in points_m]
    deflection_m = [(x - root_m) @ normal for x in bent_m]
    expected_m = 0.2 * np.cos(2 * np.pi * 0.5 * t_s) * beams_first_mode(shares)
    np.testing.assert_allclose(deflection_m, expected_m, atol=0.01 * 0.2)


def test_the_rates_are_those_of_the_vibration(wings):
    state = wings.state(0, t_s=0.7).craft.articulation
    later = wings.state(0, t_s=0.7 + 1e-4).craft.articulation.values
    earlier = wings.state(0, t_s=0.7 - 1e-4).craft.articulation.values
    np.testing.assert_allclose(state.rates, (later - earlier) / 2e-4, rtol=1e-4)


def test_damping_makes_it_smaller_by_the_logarithmic_decrement(registry):
    damped = {"wing_1_hinge_*": {**LAW, "amplitude_m": 0.01, "damping_ratio": 0.05}}
    with simulator(registry, damped) as opened:
        period_s = 2.0 / np.sqrt(1 - 0.05**2)
        first = opened.state(0, t_s=0.0).craft.articulation.values
        second = opened.state(0, t_s=period_s).craft.articulation.values
        decrement = 2 * np.pi * 0.05 / np.sqrt(1 - 0.05**2)
        np.testing.assert_allclose(second / first, np.exp(-decrement), rtol=1e-4)


def test_a_joint_with_a_key_of_its_own_is_not_the_patterns(registry):
    with simulator(
        registry, {"wing_1_*": LAW, "wing_1_hinge_2": {"law": "fixed", "value_deg": 1.0}}
    ) as opened:
        moving = {joint.name for joint in opened.spacecraft.joints}
        assert "wing_1_hinge_2" in moving
        assert not any(name.startswith("wing_2") for name in moving)


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ({"flap_*": LAW}, "has no such joint"),
        ({"wing_1_hinge_*": {**LAW, "amplitude_m": 50.0}}, "amplitude_m 50 is more than"),
        ({"wing_1*": LAW}, "beside its axis"),
    ],
)
def test_what_cannot_bend_is_refused(registry, joints, message):
    with pytest.raises(InputError, match=message), simulator(registry, joints) as opened:
        opened.state(0)
