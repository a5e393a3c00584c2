"""What a look gives, against the simulator's states and the camera's own view."""

from dataclasses import replace

import numpy as np
import pytest

from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import Look, Standpoint
from posse_core._model.camera import Camera
from posse_core._model.mount import Mount
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import load_scenario
from posse_core._simulator.scene import scene_of
from posse_core._simulator.states import States

CAMERA = Camera(96, 72, 90.0, 90.0, 47.5, 35.5, 0.01)
MOUNT = Mount(np.array([0.4, 0.1, -0.2]), np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]))
SEED = 3


@pytest.fixture(scope="module")
def world():
    """States of a tumbling Aqua at frames 20 s apart, and its scene."""
    registry = load_plugins().registry
    overrides = {
        "times": {"duration_s": 100, "count": 6},
        "attitude.camera": {"law": "track", "offset": 0.02},
        "attitude.target": {"law": "spin", "body_axis": "+x", "rate_rpm": 0.2},
        "seed": SEED,
    }
    scenario = load_scenario("aqua", registry, overrides)
    scene = replace(scene_of(scenario, registry), camera=CAMERA)
    return States(scenario, scene, registry, None), scene


def look_of(world, index: int = 2, mount: Mount = MOUNT, who: str = "sensor a", **stand) -> Look:
    states, scene = world
    state = state_of(states, index)
    caster = RayCaster(scene)
    return Look(Standpoint(state, mount, SEED, who, **stand), scene, caster.through)


def state_of(states: States, index: int, t_s: float | None = None):
    none = dict.fromkeys(
        (
            *("r_rtn_m", "v_rtn_m_s", "q_eci_from_body", "q_eci_from_camera"),
            *("omega_body_rad_s", "omega_camera_rad_s"),
        )
    )
    state = states.of_row(states.row(index, t_s=t_s, **none), index)
    return states.onward(index, state, own_frame=t_s is None)


def test_a_later_instant_is_that_of_the_scenarios_motion(world):
    """To the bit, with the frame's own pointing error."""
    then = state_of(world[0], 2, t_s=47.5).seen_from(MOUNT)
    later = look_of(world).at(7.5)
    np.testing.assert_array_equal(later.state.craft.t_body_cam_m, then.craft.t_body_cam_m)
    np.testing.assert_array_equal(later.state.craft.R_cam_from_body, then.craft.R_cam_from_body)
    np.testing.assert_array_equal(
        look_of(world, reading_s=5.0).at(2.5).state.craft.t_body_cam_m, then.craft.t_body_cam_m
    )


def test_frames_that_are_chosen_from_more_go_on_with_their_own_errors():
    """A frame's pointing error is drawn by its index before the choice."""
    registry = load_plugins().registry
    jitter = {"law": "pointing-error", "jitter_deg": [1.0, 1.0, 1.0]}
    overrides = {"attitude.camera": jitter, "frames": 3}
    scenario = load_scenario("fly-around", registry, overrides)
    states = States(scenario, scene_of(scenario, registry), registry, None)
    state = state_of(states, 1)
    assert state.onward is not None
    soon, by_rates = state.onward.at(1e-3), state.after(1e-3)
    np.testing.assert_allclose(soon.R_cam_from_eci, by_rates.R_cam_from_eci, atol=1e-8)
    np.testing.assert_allclose(soon.craft.t_body_cam_m, by_rates.craft.t_body_cam_m, atol=1e-6)


def test_by_rates_it_is_near_the_scenarios_motion(world):
    """Over a tenth of a second within what accelerations do: n² r t²/2 and the turn of the axes."""
    look = look_of(world)
    exact, near = look.at(0.1), look.at(0.1, by_rates=True)
    off_m = exact.state.craft.t_body_cam_m - near.state.craft.t_body_cam_m
    assert 0 < np.linalg.norm(off_m) < 1e-5
    turn = exact.state.craft.R_cam_from_body.T @ near.state.craft.R_cam_from_body
    assert np.abs(turn - np.eye(3)).max() < 1e-6


def test_the_next_frame_is_the_scenarios(world):
    following = look_of(world).next_frame
    assert following is not None
    assert following.index == 3
    own = state_of(world[0], 3).seen_from(MOUNT)
    np.testing.assert_array_equal(following.state.craft.t_body_cam_m, own.craft.t_body_cam_m)
    assert look_of(world, index=5).next_frame is None


def test_a_state_that_was_given_goes_on_by_its_rates(world):
    states, scene = world
    given = replace(state_of(states, 2), onward=None)
    look = Look(Standpoint(given, Mount(), SEED, "x"), scene, RayCaster(scene).through)
    later = look.at(0.5).state.craft
    np.testing.assert_array_equal(later.t_body_cam_m, given.after(0.5).craft.t_body_cam_m)
    assert look.next_frame is None
    assert look.duration_s == 0


def test_rays_meet_what_the_view_sees(world):
    """A ray through a pixel's centre, from the mount, at the depth of the view."""
    look = look_of(world, mount=Mount(np.array([0.4, 0.1, -0.2])))
    view = look.view(CAMERA)
    rows, columns = np.nonzero(view.mask)
    pixels = np.stack([columns + view.box.x0, rows + view.box.y0], axis=-1)
    rays = CAMERA.rays(pixels)
    hits = look.rays(rays)
    np.testing.assert_array_equal(hits.part_id, view.part_id[view.mask])
    depth_m = hits.distance_m / np.linalg.norm(rays, axis=1)
    np.testing.assert_allclose(depth_m, view.depth_m[view.mask], rtol=1e-6)


def test_random_numbers_belong_to_frame_sensor_reading_and_purpose(world):
    def drawn(**keys):
        look = look_of(world, **{key: keys[key] for key in keys if key != "purpose"})
        return look.generator(keys.get("purpose", "noise")).random()

    first = drawn()
    assert drawn() == first
    others = [drawn(index=3), drawn(who="sensor b"), drawn(number=1), drawn(purpose="range")]
    assert len({first, *others}) == 5


def test_time_until_the_next_reading_shrinks_as_the_look_moves_on(world):
    look = look_of(world, duration_s=0.5)
    assert look.duration_s == 0.5
    assert look.at(0.2).duration_s == pytest.approx(0.3)
