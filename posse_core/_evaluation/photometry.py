"""Whether a picture is of the scenario's image sensor, and as bright as Sun and exposure make it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._evaluation.case import Case
from posse_core._imaging.image_sensor import FULL_WELL_E_M2, ImageSensor
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.camera import Camera
from posse_core._model.spacecraft import Material
from posse_core._model.srgb import linear_from_srgb
from posse_core._scenario.sensor import SensorConfig

LEAST_PX = 100
"""Least pixels of a mask whose brightness is compared."""
LEAST_LIT_PX, LEAST_GLIMMER = 30, 0.002
"""Of so many pixels that the Sun lights, one is at least so bright, over a white plate that faces it."""
LEAST_LIT, LEAST_SUNLIGHT = 0.3, 0.9
"""Least share of the mask's pixels that the Sun lights, and of its disc that does."""
MOST_PHASE_RAD = np.radians(100)
"""Beyond it, surfaces are lit and seen at grazing angles."""
REFLECTANCE = (0.004, 2.0)
"""Bounds of the mean light of lit pixels, over that of a white plate that faces the Sun."""
LEAST_CODES = 1.5
"""Mean value, in steps of the picture, of a spacecraft of the least reflectance that is compared."""
METERED_ERROR = 0.3
"""How far the metered pixel may be from the level that auto exposure asks for, over it; noise and the
lens come after the meter."""
LEAST_METERED_PX = 400
LEAST_COLOUR, COLOUR_LEAD = 0.03, 0.35
"""Another order of the channels is a fault where it explains the parts' colours better by so much: mean
square of the logarithms of the channels over their mean, and the same as a share."""
LEAST_SHADOW_PX, MOST_IN_SHADOW = 30, 0.3
"""Of so many pixels without the Sun's light the middle one is not brighter, over a white plate in
sunlight: the Earth gives less."""
SATURATED = 0.98
LEAST_SATURATING = 1.5
"""Light of a white plate that faces the Sun, over white, from which half of a craft may saturate."""
MOST_NOISE = 0.05
"""Standard deviation of the darker half of a picture, over white, that is no sensor's noise."""
_LEAST_PART_PX, _LEAST_COSINE, _DARK = 20, 0.05, 0.002
_ORDERS = tuple(list(order) for order in permutations(range(3)))
"""Of the channels; the first is as said."""
_LEAST_CODED_STEPS = 12


def format_faults(image: AnyArray, sensor: SensorConfig) -> Iterator[str]:
    """Whether type and channels are the sensor's, and 16 bits are more than 8."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    wanted = 3 if sensor.color == "rgb" else 1
    if channels != wanted:
        yield f"the picture has {channels} channel(s), and the scenario's sensor.color is {sensor.color}"
    bits = 8 * image.dtype.itemsize
    if bits != sensor.bit_depth:
        yield f"the picture has {bits} bits, and the scenario's sensor.bit_depth is {sensor.bit_depth}"
    elif bits == 16:
        values = np.unique(image)
        if len(values) > _LEAST_CODED_STEPS and any(not (values % step).any() for step in (256, 257)):
            yield "the picture has 16 bits, but only 8 of them are used"
        elif len(values) > 1 and values[-1] < 256 <= 2**sensor.bit_depth * 0.05 and not values[0]:
            yield "the picture has 16 bits, but no value above 255"


def linear(image: AnyArray, sensor: SensorConfig) -> FloatArray:
    """(H, W, C) light as a share of white, C = 1 or 3."""
    most = np.iinfo(image.dtype).max
    offset = sensor.offset_dn if sensor.response == "linear" else 0.0
    curve = (np.arange(most + 1, dtype=np.float64) - offset) / most
    if sensor.response == "srgb":
        curve = linear_from_srgb(curve)
    light = curve[image]
    return light if light.ndim == 3 else light[..., None]


def white_share_s(sensor: SensorConfig, camera: Camera, flux_w_m2: float) -> float:
    """Share of white per second that a white plate gives that faces the Sun.

    Colours are balanced so that it is the same in each channel, and in a monochrome picture.
    """
    mono = sensor.model_copy(update={"color": "mono"})
    radiance = flux_w_m2 * SOLAR_BAND_FRACTIONS / np.pi
    electrons_s = float(ImageSensor(mono, camera).electrons_s(radiance)[0])
    full_well_e = sensor.full_well_e or FULL_WELL_E_M2 * camera.pixel_pitch_m**2
    gain_e_dn = sensor.gain_e_dn or full_well_e / (2**sensor.bit_depth - 1)
    return float(electrons_s / gain_e_dn / (2**sensor.bit_depth - 1))


def brightness_faults(
    case: Case, image: AnyArray, sensor: SensorConfig, *, by_sun: bool = True
) -> Iterator[str]:
    """Whether the target is as bright as exposure and Sun make any material.

    by_sun: the Sun is its brightest light, and not the light boxes of a laboratory.
    """
    labels = case.labels
    if not case.has("mask_rle", "fraction_lit", "phase_angle_rad", "exposure_s"):
        return
    mask, fraction_lit = case.target.mask, labels.fraction_lit or 0.0
    white = white_share_s(sensor, case.camera, labels.solar_flux_w_m2) * labels.exposure_s
    step = (1.0 / 12.92 if sensor.response == "srgb" else 1.0) / (2**sensor.bit_depth - 1)
    whole = linear(image, sensor)
    lit_px = round(fraction_lit * labels.mask_area_px)
    glimmer = LEAST_GLIMMER * white * labels.sun_fraction_target
    if by_sun and lit_px >= LEAST_LIT_PX and glimmer > LEAST_CODES * step >= float(whole.max()):
        yield f"the picture is black, and the Sun lights {lit_px} pixels of the target"
        return
    light = whole[mask]
    if by_sun and _is_lit(case):
        scale = white * fraction_lit * labels.sun_fraction_target
        reflectance = float(light.mean()) / scale
        least, most = REFLECTANCE
        if reflectance < least and least * scale > LEAST_CODES * step:
            yield (
                f"the target is too dark: as if it reflected {reflectance:.2g} of the light that"
                f" {labels.exposure_s:.3g} s gives"
            )
        saturated = float((light.max(axis=1) >= SATURATED).mean())
        if saturated > 0.5 and white < LEAST_SATURATING:
            yield f"{saturated:.0%} of the target are saturated, and no white plate is at this exposure"
        if reflectance > most and saturated < 0.5:
            yield (
                f"the target is too bright for {labels.exposure_s:.3g} s: {reflectance:.2g} of a white"
                " plate"
            )
    rule = sensor.auto_exposure
    if rule is None or labels.mask_area_px < LEAST_METERED_PX or labels.sun_fraction_target < 0.5:
        return
    least, greatest = (2.0**stops for stops in sensor.exposure_stops)
    # Only then is it certain that the metered exposure was between its limits.
    if rule.shortest_s * greatest < labels.exposure_s < rule.longest_s * least:
        metered = float(np.percentile(light.max(axis=1), rule.percentile))
        low, high = (1 - METERED_ERROR) * least, (1 + METERED_ERROR) * greatest
        if not min(low * rule.level, SATURATED) <= metered <= high * rule.level:
            yield (
                f"auto exposure brings the {rule.percentile:g}th percentile of the target to"
                f" {rule.level:g} of white, and it is {metered:.2g}"
            )


def _is_lit(case: Case) -> bool:
    """Whether most of the light of the target is the Sun's."""
    labels = case.labels
    return (
        case.has("mask_rle", "fraction_lit", "phase_angle_rad")
        and labels.mask_area_px >= LEAST_PX
        and (labels.fraction_lit or 0.0) >= LEAST_LIT
        and labels.sun_fraction_target >= LEAST_SUNLIGHT
        and labels.phase_angle_rad <= MOST_PHASE_RAD
    )


def shadow_faults(
    case: Case, image: AnyArray, sensor: SensorConfig, sunlit: Float32Array
) -> Iterator[str]:
    """Whether what the Sun does not light is dark: in a negative picture it is bright.

    sunlit: (H, W) cosine of the Sun's angle, 0 in shadow.
    """
    if not case.has("exposure_s", "solar_flux_w_m2", "phase_angle_rad"):
        return
    labels = case.labels
    white = white_share_s(sensor, case.camera, labels.solar_flux_w_m2) * labels.exposure_s
    light = linear(image, sensor).mean(axis=2)
    if labels.phase_angle_rad <= MOST_PHASE_RAD and white < LEAST_SATURATING:
        saturated = float((light >= SATURATED).mean())
        if saturated > 0.5:
            yield f"{saturated:.0%} of the picture are saturated, and no white plate is at this exposure"
            return
    shadow = case.target.mask & (case.body_seen == 0) & (sunlit == 0)
    if shadow.sum() >= LEAST_SHADOW_PX:
        seen = float(np.median(light[shadow]))
        if seen > MOST_IN_SHADOW * white:
            yield f"the target's shadow is bright: {seen / white:.2g} of a white plate in sunlight"


def colour_faults(
    case: Case,
    image: AnyArray,
    sensor: SensorConfig,
    base_colours: Sequence[FloatArray],
    sunlit: Float32Array,
) -> Iterator[str]:
    """Whether another order of the channels would explain the colours of the parts better.

    base_colours: (3,) of each part of the scene, in order of their ids.
    sunlit: (H, W) cosine of the Sun's angle, 0 in shadow, where light has a colour of its own.
    """
    labels = case.labels
    if image.ndim != 3 or not case.has("phase_angle_rad"):
        return
    if labels.sun_fraction_target < LEAST_SUNLIGHT or labels.phase_angle_rad > MOST_PHASE_RAD:
        return
    row, column = np.nonzero((sunlit > _LEAST_COSINE) & (case.part_seen >= 0))
    part, light = case.part_seen[row, column], linear(image[row, column][None], sensor)[0]
    is_clear = (light.max(axis=1) < SATURATED) & (light.min(axis=1) > _DARK)
    part, light = part[is_clear], light[is_clear]
    counts = np.bincount(part, minlength=len(base_colours))
    sums = [np.bincount(part, channel, minlength=len(base_colours)) for channel in light.T]
    chosen = [
        each for each in np.flatnonzero(counts >= _LEAST_PART_PX).tolist() if min(base_colours[each]) > 0
    ]
    if not chosen:
        return
    share = counts[chosen, None] / counts[chosen].sum()
    expected = np.array([_without_brightness(base_colours[each]) for each in chosen])
    means = np.stack(sums, axis=1)[chosen] / counts[chosen, None]
    got = np.array([_without_brightness(each) for each in means])
    as_said, *others = (float((share * (got[:, order] - expected) ** 2).sum()) for order in _ORDERS)
    best = int(np.argmin(others))
    if others[best] < (1 - COLOUR_LEAD) * as_said and as_said - others[best] > LEAST_COLOUR:
        names = "".join("RGB"[channel] for channel in np.argsort(_ORDERS[best + 1]))
        yield f"the colour channels are in the order {names}, not RGB"


def _without_brightness(colour: FloatArray) -> FloatArray:
    logarithm = np.log(np.maximum(colour, 1e-6))
    return np.asarray(logarithm - logarithm.mean())


def base_colour(material: Material) -> FloatArray:
    """(3,) mean reflectance of a material, its texture included."""
    colour = np.array(material.base_color, dtype=np.float64)
    if material.base_color_texture is not None:
        channels = material.base_color_texture.reshape(-1, 3).T
        counts = np.array([np.bincount(channel, minlength=256) for channel in channels])
        colour = colour * (counts @ linear_from_srgb(np.arange(256) / 255)) / channels.shape[1]
    return np.asarray(colour)
