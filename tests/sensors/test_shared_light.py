"""What the looks of one reading share of their light."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from moving_plate import moving, plate

from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import SensorLook, Standpoint
from posse_core._model.light import Light, LightRequest
from posse_core._model.mount import Mount
from posse_core._model.scene import FrameState
from posse_core._model.sky_view import SkyView

BLACK = SkyView(None, np.empty((0, 2)), np.empty((0, 3)))


def asked(state: FrameState) -> tuple[SensorLook, list[LightRequest]]:
    """A look, and the requests for light that it makes."""
    requests: list[LightRequest] = []

    def gather(request: LightRequest) -> Light:
        requests.append(request)
        return Light(request.camera, BLACK, None)

    scene = plate()
    stand = Standpoint(state, Mount(), 0, "sensor a")
    return SensorLook(stand, scene, RayCaster(scene).through, gather), requests


def turn_rad(one: FrameState, other: FrameState) -> float:
    cosine = (np.trace(one.R_cam_from_eci @ other.R_cam_from_eci.T) - 1) / 2
    return float(np.arccos(np.clip(cosine, -1, 1)))


@given(rate_deg_s=st.floats(0, 30), after_s=st.floats(-2, 2), by_rates=st.booleans())
def test_earthshine_is_within_half_a_degree_of_the_cameras_turn(
    rate_deg_s: float, after_s: float, by_rates: bool
) -> None:
    look, requests = asked(moving(omega_camera=(0, np.radians(rate_deg_s), 0)))
    look.at(after_s, by_rates=by_rates).light()
    (request,) = requests
    assert turn_rad(request.earthshine, request.state) <= np.radians(0.5) + 1e-7
    # The Earth itself turns in view by up to 0.0012 rad/s.
    assert abs(request.earthshine.t_s - request.state.t_s) * 0.0012 <= np.radians(0.5) + 1e-7


def test_neighbouring_instants_share_one_earthshine_and_other_readings_have_their_own() -> None:
    look, requests = asked(moving(omega_camera=(0, np.radians(2.0), 0)))
    for after_s in (0.0, 0.1, 0.2, 0.3, 0.4):
        look.at(after_s).light()
    states = [request.earthshine for request in requests]
    assert states[0] is states[1] is states[2]
    assert states[3] is states[4]
    assert states[3] is not states[0]
    other, more = asked(replace(moving(), index=1))
    other.light()
    assert more[0].earthshine is not states[0]
    assert more[0].earthshine.index == 1


def test_a_known_sky_is_passed_on() -> None:
    look, requests = asked(moving())
    sky = SkyView(None, np.ones((1, 2)), np.ones((1, 3)))
    look.light(sky=sky)
    look.light()
    assert requests[0].sky is sky
    assert requests[1].sky is None
    assert {request.purpose for request in requests} == {"sensor a 0: renderer"}
