"""What can be wrong with a stored reading of the thermal camera."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from posse_core._arrays import AnyArray, Float32Array, array_fault
from posse_core._interfaces.sensor import StoredReading
from posse_core._model.camera import Camera
from posse_core._sensors.thermal.detector import Detector
from posse_core._sensors.thermal.options import ThermalOptions
from posse_core._sensors.thermal.planck import SPACE_K

_HOTTEST_K = 2000.0
"""No surface near the Earth is hotter."""
_FAULTY_SHARE = 0.002
"""Share of pixels that may differ: of the border by rounding, of the noise by chance."""
_RAYS = 20_000
"""About as many pixels are compared with the geometry."""


def faults_of(stored: StoredReading, options: ThermalOptions) -> Iterator[str]:
    """What is wrong with a reading, one line each."""
    camera, arrays, image = stored.camera, stored.reading.arrays, stored.reading.image
    if camera is None or image is None:
        yield "the thermal image or its camera is missing"
        return
    shape = (camera.height_px, camera.width_px)
    for name in ("temperature_k", "radiance_w_m2_sr", "brightness_temperature_k"):
        fault = array_fault(arrays.get(name), shape, "float32", finite=name != "temperature_k")
        if fault is not None:
            yield f"{name} {fault}"
            return
    yield from _temperature(arrays["temperature_k"], stored, camera)
    radiance = arrays["radiance_w_m2_sr"]
    if radiance.min() < 0:
        yield "radiance_w_m2_sr is negative"
    away_k = np.max(np.abs(options.band.temperature_k(radiance) - arrays["brightness_temperature_k"]))
    if not away_k < 0.01:
        yield f"brightness_temperature_k is up to {away_k:.3g} K from that of the radiance"
    yield from _image(image, radiance, stored, options)


def _temperature(image_k: Float32Array, stored: StoredReading, camera: Camera) -> Iterator[str]:
    """Temperatures within bounds, and where the spacecraft is."""
    on = np.isfinite(image_k)
    # A single-precision number may be a little below the double-precision bound that it was rounded
    # from.
    low_k, high_k = SPACE_K - 1e-6, _HOTTEST_K
    if (np.isinf(image_k) | (on & ((image_k < low_k) | (image_k > high_k)))).any():
        yield f"temperature_k is not from {SPACE_K:g} to {_HOTTEST_K:g} K everywhere"
    for key, extreme in (("coldest_k", np.min), ("hottest_k", np.max)):
        said, true = stored.reading.labels.get(key), float(extreme(image_k[on])) if on.any() else None
        if said != true:
            yield f"{key} is {said}, and that of temperature_k is {true}"
    step = max(1, int(np.sqrt(image_k.size / _RAYS)))
    v, u = np.mgrid[: camera.height_px : step, : camera.width_px : step]
    uv_px = np.stack([u, v], axis=-1).astype(np.float64).reshape(-1, 2)
    distance_m = stored.distances_m(camera.rays(uv_px), np.zeros(3), camera.row_after_s(uv_px[:, 1]))
    wrong = np.isfinite(distance_m) != on[::step, ::step].reshape(-1)
    if wrong.mean() > _FAULTY_SHARE:
        yield f"{wrong.mean():.2%} of temperature_k's pixels are on the craft where it is not, or off it"


def _image(
    image: AnyArray, radiance: Float32Array, stored: StoredReading, options: ThermalOptions
) -> Iterator[str]:
    """Digital numbers against the radiance that they are of, within the noise."""
    detector = Detector(options, (1, 1), 0, "")
    for key in ("gain_w_m2_sr_dn", "offset_w_m2_sr"):
        said, true = stored.reading.labels.get(key), getattr(detector, key)
        if said is None or not np.isclose(said, true, rtol=1e-9):
            yield f"{key} is {said}, and that of the options is {true}"
            return
    gain = detector.gain_w_m2_sr_dn
    sigma_dn = np.hypot(detector.noise_w_m2_sr, detector.pattern_sigma_w_m2_sr) / gain
    expected_dn = (radiance - detector.offset_w_m2_sr) / gain
    far = np.abs(image - np.clip(expected_dn, 0, detector.largest_dn)) > 6 * sigma_dn + 0.6
    if far.mean() > _FAULTY_SHARE:
        yield f"{far.mean():.2%} of the digital numbers are beyond the noise of their radiance"
