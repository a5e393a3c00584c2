"""The sensor ``events`` from the light of a scene to what a dataset holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from moving_plate import PlateRenderer, moving, plate

import posse_core as posse
from posse_core._errors import InputError
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import SensorLook, Standpoint
from posse_core._interfaces.sensor import SensorSetting
from posse_core._model.labels import Labels
from posse_core._model.light import Light, LightRequest
from posse_core._model.mount import Mount
from posse_core._model.reading import Reading
from posse_core._model.scene import FrameState, RenderRequest
from posse_core._model.sky_view import SkyView
from posse_core._scenario.sensor import SensorConfig
from posse_core._sensors.events.event_camera import EventCamera
from posse_core._sensors.events.options import EventsOptions

BLACK = SkyView(None, np.empty((0, 2)), np.empty((0, 3)))
SHARP = SensorConfig(psf=None)
QUIET: Mapping[str, Any] = {
    "threshold_sigma": 0.0,
    "leak_hz": 0.0,
    "shot_noise_hz": 0.0,
    "refractory_s": 0.0,
    "sensor": SHARP,
}


def opened(seed: int = 7, **options: Any) -> EventCamera:
    sensor = EventCamera(EventsOptions(**options))
    scene = plate()
    sensor.open(
        SensorSetting(
            name="dvs",
            seed=seed,
            scene=scene,
            image_sensor=SensorConfig(),
            mount=Mount(),
            annotate=lambda look: Labels({}),
        )
    )
    return sensor


Gather = Callable[[LightRequest], Light]


def look_at(state: FrameState, gather: Gather, *, seed: int = 7, duration_s: float = 0.0) -> SensorLook:
    scene = plate()
    stand = Standpoint(state, Mount(), seed, "sensor dvs", duration_s=duration_s)
    return SensorLook(stand, scene, RayCaster(scene).through, gather)


def flickering(amplitude: float, f_hz: float) -> Gather:
    """A sky whose radiance is the same everywhere, and whose logarithm is a sine."""

    def gather(request: LightRequest) -> Light:
        camera = request.camera
        level = np.exp(amplitude * np.sin(2 * np.pi * f_hz * request.state.t_s))
        radiance = np.full((camera.height_px, camera.width_px, 3), level, dtype=np.float32)
        return Light(camera, replace(BLACK, radiance_rgb=radiance), None)

    return gather


def of_plate(request: LightRequest) -> Light:
    """The moving plate of radiance 1 before black."""
    camera, craft = request.camera, request.state.craft
    renderer = PlateRenderer(None)
    renderer.open(plate())
    box = RayCaster(plate()).box(craft).grown(1, camera)
    return Light(camera, BLACK, renderer.render(RenderRequest(craft, box, None, 0)))


def test_a_plate_that_comes_in_makes_events_when_its_share_of_a_pixel_crosses_the_levels() -> None:
    """Its right edge moves by 50 px/s: the light of a pixel grows linearly in 20 ms from 0 to 20 floors,
    so its response goes from −1 to ln 20. Crossed levels are a threshold apart, to what the response
    bends between renders, 20² · 0.02² / 8."""
    floor_e_s = full_e_s(opened(**QUIET)) / 20
    sensor = opened(**QUIET, floor_e_s=floor_e_s, threshold_on=0.25, step_px=0.02)
    state = moving(v_m_s=(5.0, 0.0, 0.0))
    reading = sensor.sense(look_at(state, of_plate, duration_s=0.2))
    assert reading.labels["renders"] >= 0.2 * 50 / 0.02
    x, y, t_s = (reading.arrays[name] for name in ("x", "y", "t_us"))
    t_s = t_s * 1e-6
    right_px = (96 - 1) / 2 + 100 * 2.03 / 10
    first, last = np.ceil(right_px + 0.5), np.floor(right_px + 10 - 0.5)
    swept = np.arange(first, last + 1)
    assert len(swept) == 9
    contrast = 1 + np.log(20)
    for column in swept:
        for row in (20, 36, 50):
            times_s = t_s[(x == column) & (y == row)]
            share = np.clip(right_px + 50 * times_s - (column - 0.5), 0, 1)
            level = np.where(share * 20 > 1, np.log(np.maximum(share * 20, 1)), share * 20 - 1)
            np.testing.assert_allclose(np.diff(level), 0.25, atol=0.025)
            assert len(times_s) == 1 + np.floor((contrast - 1 - level[0]) / 0.25 + 1e-9)
    left_px = (96 - 1) / 2 - 100 * 2.03 / 10
    assert set(x[reading.arrays["p"] == 1]) <= set(np.arange(first - 1, last + 2))
    assert set(x[reading.arrays["p"] == 0]) <= set(np.arange(np.floor(left_px), left_px + 12))


def test_at_half_a_pixel_from_render_to_render_an_edge_makes_the_same_events_nearly_in_time() -> None:
    """Half a pixel takes 10 ms. Against renders a fiftieth of that apart each event is there, and no
    later or earlier than 0.75 of it."""
    floor_e_s = full_e_s(opened(**QUIET)) / 1e4
    by_step = []
    for step_px in (0.01, 0.5):
        sensor = opened(**QUIET, floor_e_s=floor_e_s, step_px=step_px)
        arrays = sensor.sense(look_at(moving(v_m_s=(5.0, 0.0, 0.0)), of_plate, duration_s=0.2)).arrays
        order = np.lexsort((arrays["t_us"], arrays["p"], arrays["x"], arrays["y"]))
        by_step.append({name: array[order].astype(int) for name, array in arrays.items()})
    fine, coarse = by_step
    for name in ("x", "y", "p"):
        np.testing.assert_array_equal(fine[name], coarse[name])
    off_us = coarse["t_us"] - fine["t_us"]
    assert np.abs(off_us).max() < 7500
    assert np.sqrt(np.mean(off_us**2)) < 3000


def full_e_s(sensor: EventCamera) -> float:
    """Electrons per second of a pixel that sees radiance 1 in each band, by docs/sensor.md."""
    pixel_m2 = (0.036 / 96) ** 2
    photon_j = 6.62607015e-34 * 299792458 / np.array([650e-9, 550e-9, 450e-9])
    return float(np.pi / (4 * 16**2) * pixel_m2 * (np.array([0.45, 0.50, 0.40]) / photon_j).sum())


def test_flicker_makes_the_events_of_its_crossed_levels_in_each_period() -> None:
    """ln I = sin(2π 10 t): each half period crosses ⌊2 / θ⌋ levels or one less, the same both ways."""
    sensor = opened(**QUIET, threshold_on=0.3, threshold_off=0.3, window_s=0.5, least_rate_hz=2000)
    reading = sensor.sense(look_at(moving(), flickering(1.0, 10.0)))
    x, y, t_us, p = (reading.arrays[name].astype(int) for name in ("x", "y", "t_us", "p"))
    period = (t_us + 25_000) // 100_000  # from trough to trough
    whole = (period >= 1) & (period <= 4)
    counts = np.zeros((72, 96, 2, 5), dtype=int)
    np.add.at(counts, (y[whole], x[whole], p[whole], period[whole]), 1)
    assert set(np.unique(counts[..., 1:])) <= {5, 6}
    assert (counts[..., 0, 1:] == counts[..., 1, 1:]).mean() > 0.999
    assert (counts[..., 1, 1:] == counts[..., 1, 1:2]).mean() > 0.999
    # Of lattices of step 0.3 with an even phase, the share 2 / 0.3 − 6 has 7 levels within ±1.
    assert (counts[..., 1, 2] == 6).mean() == pytest.approx(2 / 0.3 - 6, abs=0.03)


def test_the_pattern_of_thresholds_is_fixed_and_the_start_is_not() -> None:
    """Of two frames the gaps between events agree in each pixel, and the first events do not."""
    options = {**QUIET, "threshold_sigma": 0.03, "window_s": 0.1, "least_rate_hz": 100}

    def ramp(request: LightRequest) -> Light:
        camera, t_s = request.camera, request.state.t_s
        radiance = np.full((camera.height_px, camera.width_px, 3), np.exp(20 * (t_s % 10)))
        return Light(camera, replace(BLACK, radiance_rgb=radiance.astype(np.float32)), None)

    def first_and_gap(state: FrameState, seed: int) -> tuple[np.ndarray, np.ndarray]:
        reading = opened(seed, **options).sense(look_at(state, ramp, seed=seed))
        pixel = reading.arrays["y"].astype(int) * 96 + reading.arrays["x"]
        order = np.argsort(pixel, kind="stable")
        _, start = np.unique(pixel[order], return_index=True)
        t_us = reading.arrays["t_us"][order]
        return t_us[start], t_us[start + 1] - t_us[start]

    state = moving()
    first, gap = first_and_gap(state, 7)
    first_later, gap_later = first_and_gap(replace(state, index=1, t_s=10.0), 7)
    np.testing.assert_allclose(gap, gap_later, atol=3)
    assert abs(np.corrcoef(first, first_later)[0, 1]) < 0.2
    assert abs(np.corrcoef(gap, first_and_gap(state, 8)[1])[0, 1]) < 0.05
    assert gap.std() == pytest.approx(0.03 / 20 * 1e6, rel=0.05)


def test_a_sky_that_is_mixed_makes_the_events_of_one_that_is_computed_each_time() -> None:
    """Waves of 20 px move by 50 px/s, since the camera turns. Half a pixel apart, skies are mixed to
    (2π 0.5 / 20)² / 8 of their amplitude, which is 1 % of a threshold."""
    computed = [0, 0]

    def waves(mixes: bool) -> Gather:
        def gather(request: LightRequest) -> Light:
            if mixes and request.sky is not None:
                return Light(request.camera, request.sky, None)
            computed[mixes] += 1
            right = request.state.R_cam_from_eci[0]
            turned_px = 100 * np.arctan2(right[2], right[0])
            columns = np.arange(96) - turned_px
            level = np.exp(0.5 * np.sin(2 * np.pi * columns / 20))
            radiance = np.tile(level[:, None], (72, 1, 3)).astype(np.float32)
            return Light(request.camera, replace(BLACK, radiance_rgb=radiance), None)

        return gather

    sensor = opened(**QUIET, window_s=0.2, least_rate_hz=1000)
    state = moving(omega_camera=(0.0, 0.5, 0.0))
    counts = []
    for mixes in (False, True):
        arrays = sensor.sense(look_at(state, waves(mixes))).arrays
        made = np.zeros((72, 96, 2), dtype=int)
        np.add.at(made, (arrays["y"], arrays["x"], arrays["p"]), 1)
        counts.append(made)
    assert computed[0] == 201
    assert computed[1] < 40
    assert counts[0].sum() > 20_000
    assert (counts[0] == counts[1]).mean() > 0.98
    assert np.abs(counts[0] - counts[1]).max() <= 1


def test_a_recording_without_an_end_is_empty() -> None:
    """The last frame of a sequence has no next one."""
    reading = opened().sense(look_at(moving(), flickering(1.0, 10.0)))
    assert reading.labels == {"window_s": 0.0, "events": 0, "on_events": 0, "renders": 0}
    assert all(len(array) == 0 for array in reading.arrays.values())


def test_too_fast_motion_is_refused_with_the_way_out() -> None:
    sensor = opened(window_s=10.0)
    with pytest.raises(InputError, match=r"^sensors.dvs: frame 0: 10 s .* shorten window_s"):
        sensor.sense(look_at(moving(v_m_s=(50.0, 0.0, 0.0)), of_plate))


SMALL: Mapping[str, Any] = {
    "frames": 2,
    "camera.width_px": 64,
    "camera.height_px": 48,
    "sky": {"earth": False, "stars": None},
    "sensors": {
        "dvs": {
            "type": "events",
            "camera": {"width_px": 48, "height_px": 32, "hfov_deg": 40},
            "window_s": 0.05,
            "least_rate_hz": 60,
            "formats": ["h5"],
        }
    },
}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> posse.Dataset:
    pytest.importorskip("moderngl")
    folder = tmp_path_factory.mktemp("events") / "d"
    return posse.run("aqua", folder, renderer="raster", overrides=SMALL, workers=1)


def test_a_dataset_holds_the_recording_that_the_simulator_makes(dataset: posse.Dataset) -> None:
    with posse.open("aqua", renderer="raster", overrides=SMALL) as simulator:
        for i in range(2):
            (made,) = simulator.frame(simulator.state(dataset[i].index)).readings["dvs"]
            (read,) = dataset.readings(i, "dvs")
            assert made.labels == read.labels
            assert made.labels["events"] > 50
            for name, array in made.arrays.items():
                np.testing.assert_array_equal(array, read.arrays[name])
    assert (dataset.folder / "sensors/dvs/000000.h5").is_file()


def test_a_recording_as_it_was_written_has_no_faults(dataset: posse.Dataset) -> None:
    assert list(faults(dataset)) == []


def faults(dataset: posse.Dataset, **changed: Any) -> list[str]:
    (reading,) = dataset.readings(0, "dvs")
    (labels,) = dataset[0].sensors["dvs"]
    stored = posse.StoredReading(
        index=0,
        labels=labels,
        reading=Reading(reading.labels, {**reading.arrays, **changed}),
        camera=dataset.sensors["dvs"].camera,
        mount=Mount(),
        parts=(),
        distances_m=lambda *_: np.empty(0),
    )
    return list(EventCamera(EventsOptions()).faults(stored))


@pytest.mark.parametrize(
    ("name", "damage", "fault"),
    [
        ("t_us", lambda t: t[::-1].copy(), "not ascending"),
        ("t_us", lambda t: t + 50_000, "not within the window"),
        ("t_us", lambda t: t - 50_000, "not within the window"),
        ("x", lambda x: x + np.uint16(40), "x is outside the image"),
        ("y", lambda y: y + np.uint16(40), "y is outside the image"),
        ("p", lambda p: p + np.uint8(1), "p is neither 0 nor 1"),
        ("p", lambda p: 1 - p, "on_events is"),
        ("p", lambda p: p[:-1], "p is not uint8"),
        ("x", lambda x: x.astype(np.int32), "x is not uint16"),
    ],
)
def test_a_damaged_recording_is_found(
    dataset: posse.Dataset, name: str, damage: Callable[[Any], Any], fault: str
) -> None:
    (reading,) = dataset.readings(0, "dvs")
    assert any(fault in found for found in faults(dataset, **{name: damage(reading.arrays[name])}))


def test_events_that_are_missing_are_found(dataset: posse.Dataset) -> None:
    (reading,) = dataset.readings(0, "dvs")
    fewer = {name: array[:-1] for name, array in reading.arrays.items()}
    assert any("events is" in found for found in faults(dataset, **fewer))
