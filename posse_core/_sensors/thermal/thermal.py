"""A long-wave infrared camera: images of the heat that surfaces radiate."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from posse_core._constants import Constants
from posse_core._errors import InputError
from posse_core._imaging.psf import make_psf
from posse_core._interfaces.look import SensorLook
from posse_core._interfaces.sensor import Sensor, SensorSetting, StoredReading
from posse_core._model.reading import Reading
from posse_core._model.scene import FrameState
from posse_core._scenario.sensor import PsfConfig
from posse_core._sensors.thermal.detector import Detector
from posse_core._sensors.thermal.faults import faults_of
from posse_core._sensors.thermal.heating import Surroundings, history
from posse_core._sensors.thermal.model import Temperatures, ThermalModel
from posse_core._sensors.thermal.options import ThermalOptions
from posse_core._sensors.thermal.picture import radiance_w_m2_sr, true_temperature_k
from posse_core._sensors.thermal.surfaces import surfaces_of


class ThermalCamera(Sensor[ThermalOptions]):
    """Images of heat, with the true temperature of the surface in every pixel."""

    def open(self, setting: SensorSetting) -> None:
        options, scene = self.options, setting.scene
        if scene.others or scene.spacecraft.joints:
            raise InputError(
                "the thermal camera computes the heat of a rigid target alone; leave out bodies and"
                " joints"
            )
        surfaces = surfaces_of(scene.spacecraft, options.materials, options.parts)
        self._model = ThermalModel.of(
            scene.spacecraft, surfaces, facet_m=options.facet_m, thin_m=options.thin_m
        )
        self._camera = self.camera = options.camera.camera()
        shape = (self._camera.height_px, self._camera.width_px)
        self._detector = Detector(options, shape, setting.seed, setting.name)
        spot = PsfConfig(sigma_px=options.psf_sigma_px) if options.psf_sigma_px else None
        self._psf = make_psf(spot, options.f_number, self._camera.pixel_pitch_m)

    def sense(self, look: SensorLook) -> Reading:
        options, camera, model = self.options, self._camera, self._model
        at = self._temperatures(look)
        temperature_k = true_temperature_k(look, model.facets, camera, at.temperature_k)
        sides = model.radiance_w_m2_sr(at, options.band)
        sharp = radiance_w_m2_sr(
            look, model.facets, camera, sides, options.band, options.samples_per_axis
        )
        radiance = self._psf.blur(sharp[..., None])[..., 0]
        seen_k = temperature_k[np.isfinite(temperature_k)]
        return Reading(
            labels={
                "gain_w_m2_sr_dn": self._detector.gain_w_m2_sr_dn,
                "offset_w_m2_sr": self._detector.offset_w_m2_sr,
                "coldest_k": float(seen_k.min()) if seen_k.size else None,
                "hottest_k": float(seen_k.max()) if seen_k.size else None,
                "unclosed_k": at.change_k,
            },
            arrays={
                "temperature_k": temperature_k,
                "radiance_w_m2_sr": radiance,
                "brightness_temperature_k": options.band.temperature_k(radiance).astype(np.float32),
            },
            image=self._detector.image(radiance, look.generator("noise")),
        )

    def faults(self, stored: StoredReading) -> Iterator[str]:
        return faults_of(stored, self.options)

    def _temperatures(self, look: SensorLook) -> Temperatures:
        options = self.options
        if options.mode == "steady":
            return self._model.steady(Surroundings.of(look.state))
        if not look.follows_scenario:
            raise InputError(
                "a thermal camera's mode 'transient' needs the motion before the frame, which is not"
                " known of a state that is given to the simulator; use mode: steady"
            )
        lead_s = _period_s(look.state) if options.lead_s is None else options.lead_s
        past = history(lambda after_s: Surroundings.of(look.at(after_s).state), lead_s, options.steps)
        return self._model.transient(past)


def _period_s(state: FrameState) -> float:
    """Orbital period of the chaser, which is close to the target's, by the vis-viva equation."""
    mu = Constants().mu_earth_m3_s2
    speed_m_s = np.linalg.norm(state.v_camera_eci_m_s)
    inverse_m = 2 / np.linalg.norm(state.r_camera_eci_m) - speed_m_s**2 / mu
    if inverse_m <= 0:
        raise InputError("the orbit has no period; give the thermal camera's lead_s")
    return float(2 * np.pi / np.sqrt(mu * inverse_m**3))
