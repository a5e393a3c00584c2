"""Whether the pictures show what their labels say.

What light shows of each body by the labels (:mod:`drawings`) is compared with the picture, shifted and
not, with its mirror images, and with the pictures of the frames beside. A picture is proven if it fits
best where it is, and so sharply that a shift of 2 px in any direction would be told. A frame in which
too little is seen, because it is in eclipse, backlit, saturated, too small, or blurred by motion, proves
nothing either way, and is counted as such.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from posse_core._arrays import AnyArray, Float32Array
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import inside
from posse_core._errors import InputError
from posse_core._evaluation.case import Case
from posse_core._evaluation.drawings import DrawingFit, Scene, Slopes, scene_of
from posse_core._evaluation.photometry import (
    MOST_NOISE,
    SATURATED,
    brightness_faults,
    colour_faults,
    format_faults,
    shadow_faults,
    white_share_s,
)
from posse_core._evaluation.result import Fault, Result
from posse_core._evaluation.scenarios import Scenarios
from posse_core._model.srgb import linear_from_srgb
from posse_core._scenario.model import Scenario
from posse_core._scenario.sensor import SensorConfig

LEAST_SUNLIGHT = 0.3
"""Least share of the Sun's disc that must light the spacecraft."""
LEAST_LIT_PX, LEAST_BRIGHTNESS = 100, 6.0
"""A target of which the Sun lights so many pixels, so bright over the picture's noise and over a step of
its numbers, must be seen."""
MOST_SATURATED = 0.3
"""Share of the target's pixels that are as white as can be, from which their slopes are lost."""
OTHER_SHARE = 0.25
"""A picture that correlates less with the drawing of a target that must be seen shows something else."""
PROVEN_SHARE, PROVEN_MARGIN = 0.3, 0.01
"""Least correlation of a picture that is proven, and by how much its :attr:`DrawingFit.sharpness` must
exceed the gain by which a shift is told."""
SHIFT_GAIN, RIVAL_LEAD, BESIDE_LEAD, BESIDE_PX = 0.03, 0.05, 0.1, 400
"""By how much more a shifted picture must correlate, a mirrored one or another frame's drawing, and both
where it is a body beside the target, or a target that need not be seen; of these, only one of so many
pixels tells: a small one may look like what it is before or behind."""
TOLD_APART = 0.1
"""Two frames' pictures tell them apart if they correlate more with their own drawings than with each
other's, by so much of what one of them correlates more with the other's."""
RIVAL_SCATTER = 1.5
"""A mirrored picture or another frame's drawing leads by chance by less than this over the root of the
number of the body's pixels."""
RIVAL_SHARE = 0.35
"""Least correlation of a mirrored picture or of another frame's drawing."""
MIRRORED = ((True, False), (False, True), (True, True))
"""Axes x and y in which a picture may be mirrored."""
MOST_SMEAR_PX, MOST_SMEARED = 3.0, 90
"""Motion during the exposure above which the pose of the instant proves nothing: this percentile of that
of the target's vertices in the image."""
REMEMBERED, _MOST_REMEMBERED_PX = 4, 1 << 23
"""Frames before a frame whose pictures are compared with it, and the most pixels of them all."""


def light_of(image: AnyArray, response: str) -> Float32Array:
    """(H, W) mean over the channels of a picture's light, as a share of white."""
    codes = np.iinfo(image.dtype).max + 1
    curve = np.arange(codes, dtype=np.float64) / (codes - 1)
    if response == "srgb":
        curve = linear_from_srgb(curve)
    light = curve.astype(np.float32)[image]
    return light if light.ndim == 2 else np.asarray(light.mean(axis=2))


def noise_of(light: Float32Array) -> float:
    """Standard deviation of the noise in the darker half of a picture, by differences of neighbours."""
    difference = (light[:, 1:] - light[:, :-1])[light[:, 1:] <= np.median(light)]
    return float(1.4826 / np.sqrt(2) * np.median(np.abs(difference)))


@dataclass
class _Kept:
    """A frame whose picture was compared, kept for those after it.

    Attributes:
        must_be_seen: whether the Sun shows enough of the target for any picture of it to correlate.
        fits: of its own drawings.
    """

    index: int
    slopes: Slopes
    scene: Scene
    must_be_seen: bool
    fits: dict[str, DrawingFit] = field(default_factory=dict)
    is_at_fault: bool = False

    def lead(self, name: str, of_sure: float) -> float | None:
        """By how much more something else must correlate with a body; None if the body tells nothing.

        of_sure: where the body is the target, and must be seen.
        """
        if self.must_be_seen and not name:
            return of_sure
        return BESIDE_LEAD if self.scene.drawings[name].px >= BESIDE_PX else None

    @property
    def is_proven(self) -> bool:
        """Whether the target is seen where it is, or a body beside one that is too small or outside."""
        decisive = {"": self.fits[""]} if "" in self.fits else self.fits
        return any(
            (lead := self.lead(name, SHIFT_GAIN)) is not None
            and fit.sharpness > lead + PROVEN_MARGIN
            and fit.correlation > PROVEN_SHARE
            and not fit.is_shifted
            for name, fit in decisive.items()
        )


class PictureChecks:
    """The checks of every picture of a dataset, a result for each."""

    def __init__(self, scenarios: Scenarios) -> None:
        self._scenarios = scenarios
        self._places = Result("picture", "outlines and shading are where the labels have them")
        self._light = Result(
            "light", "pictures are as bright, and as coloured, as sensor and Sun make them"
        )
        self._unproven: Counter[str] = Counter()
        self._before: deque[_Kept] = deque()

    @property
    def results(self) -> tuple[Result, ...]:
        """What was found so far; frames that prove nothing are not counted as checked, but told."""
        if self._unproven:
            reasons = ", ".join(f"{count} {why}" for why, count in sorted(self._unproven.items()))
            self._places.proves = f"{self._places.proves.split('; ')[0]}; not to be proven: {reasons}"
        return self._places, self._light

    def check(self, case: Case) -> None:
        """Check the picture of a frame whose label line is right."""
        try:
            image = read_image(inside(case.dataset.folder, case.labels.image))
        except InputError:
            return  # said by ``files``
        self.compare(case, image)

    def scene(self, case: Case) -> Scene:
        """What a frame's picture is compared with."""
        colours = self._scenarios.base_colours(case.labels)
        reflectance = np.array([colour.mean() for colour in colours])
        if len(reflectance) != len(case.parts):
            reflectance = np.ones(len(case.parts))
        return scene_of(case, reflectance)

    def compare(self, case: Case, image: AnyArray) -> None:
        """Check a frame's picture (H, W) or (H, W, 3), uint8 or uint16."""
        labels = case.labels
        if image.shape[:2] != (case.camera.height_px, case.camera.width_px):
            return
        sensor = self._scenarios.sensor(labels)
        has_labels = case.has("mask_rle", "q_cam_from_body", "t_body_cam_m", "sun_direction_body")
        why = _why_not(case) if has_labels else ""
        scene = self.scene(case) if why is None else None
        self._light.checked += 1
        if sensor is not None:
            wrong = list(format_faults(image, sensor))
            wrong = wrong or list(self._light_faults(case, image, sensor, scene))
            self._light.faults += [Fault(labels.index, text) for text in wrong]
        if why:
            self._unproven[why] += 1
        if scene is not None:
            light = light_of(image, "linear" if sensor is None else sensor.response)
            self._compare_places(case, sensor, light, scene)

    def _compare_places(
        self, case: Case, sensor: SensorConfig | None, light: Float32Array, scene: Scene
    ) -> None:
        labels = case.labels
        noise = noise_of(light)
        if noise > MOST_NOISE:
            self._places.checked += 1
            text = f"the picture is noise: neighbours differ by {noise:.2g} of white"
            self._places.faults.append(Fault(labels.index, text))
            return
        must_be_seen = self._must_be_seen(case, sensor, light, noise, scene)
        kept = _Kept(labels.index, Slopes(light), scene, must_be_seen)
        kept.fits = {name: drawing.fit(kept.slopes) for name, drawing in scene.drawings.items()}
        faults = list(self._faults(kept))
        if must_be_seen and not faults:
            faults += _something_else(kept.fits[""])
        of_earlier = [each for each in self._before if not each.is_at_fault and list(_shows(each, kept))]
        text = f"the picture shows frame {kept.index}: what light shows then fits it better"
        self._places.faults += [Fault(each.index, text) for each in of_earlier]
        kept.is_at_fault = bool(faults)
        self._places.faults += [Fault(labels.index, text) for text in faults[:1]]
        self._remember(kept)
        if faults or kept.is_proven:
            self._places.checked += 1
        else:
            self._unproven["too small, dark or bright" if scene.drawings else "too small"] += 1

    def _remember(self, kept: _Kept) -> None:
        self._before.append(kept)
        most = min(REMEMBERED, max(1, _MOST_REMEMBERED_PX // kept.slopes.field[0].size))
        while len(self._before) > most:
            self._before.popleft()

    def _faults(self, kept: _Kept) -> Iterator[str]:
        """What is wrong with a picture that the drawings of its labels fit as they do."""
        for x, y in MIRRORED:
            axes = " and ".join("xy"[i] for i, on in enumerate((x, y)) if on)
            for name in _better(kept.scene, kept.slopes.mirrored(x, y), kept):
                yield f"the picture is mirrored in {axes}: what light shows fits that better{_of(name)}"
        for other in self._before:
            for name in _shows(kept, other):
                yield (
                    f"the picture shows frame {other.index}: what light shows then fits it better"
                    f"{_of(name)}"
                )
        for name, fit in kept.fits.items():
            lead = kept.lead(name, SHIFT_GAIN)
            if lead is None or not fit.is_shifted or fit.best <= PROVEN_SHARE:
                continue
            if fit.best - fit.correlation > lead:
                u_px, v_px = (round(each) for each in fit.shift_px)
                yield f"the picture is shifted by ({u_px}, {v_px}) px{_of(name)}"

    def _must_be_seen(
        self,
        case: Case,
        sensor: SensorConfig | None,
        light: Float32Array,
        noise: float,
        scene: Scene,
    ) -> bool:
        """As :class:`_Kept` has it."""
        drawing = scene.drawings.get("")
        if drawing is None or drawing.lit_px < LEAST_LIT_PX:
            return False
        if not _is_by_sun(self._scenarios.of(case.labels)):
            return False
        if float((light[case.target.mask] >= SATURATED).mean()) > MOST_SATURATED:
            return False
        if sensor is None or not case.has("exposure_s", "solar_flux_w_m2"):
            return False  # how bright it is in the picture is not known
        labels = case.labels
        white_s = white_share_s(sensor, case.camera, labels.solar_flux_w_m2)
        step = (1 / 12.92 if sensor.response == "srgb" else 1) / (2**sensor.bit_depth - 1)
        seen = white_s * labels.exposure_s * labels.sun_fraction_target * drawing.brightness
        return bool(seen > LEAST_BRIGHTNESS * max(noise, step))

    def _light_faults(
        self, case: Case, image: AnyArray, sensor: SensorConfig, scene: Scene | None
    ) -> Iterator[str]:
        by_sun = _is_by_sun(self._scenarios.of(case.labels))
        yield from brightness_faults(case, image, sensor, by_sun=by_sun)
        if by_sun and scene is not None:
            yield from shadow_faults(case, image, sensor, scene.sunlit)
            colours = self._scenarios.base_colours(case.labels)
            if len(colours) == len(case.parts):
                yield from colour_faults(case, image, sensor, colours, scene.sunlit)


def _is_by_sun(scenario: Scenario | None) -> bool:
    """Whether the Sun is the brightest light, and not the light boxes of a laboratory."""
    laboratory = None if scenario is None else scenario.sky.laboratory
    return laboratory is None or not any(laboratory.boxes)


def _something_else(fit: DrawingFit) -> Iterator[str]:
    if fit.correlation < OTHER_SHARE:
        yield (
            "the picture shows something else: it correlates with what light shows by"
            f" {fit.correlation:.0%}"
        )


def _better(scene: Scene, slopes: Slopes, kept: _Kept) -> Iterator[str]:
    """Names of the bodies whose drawings in a scene fit slopes clearly better than a frame's own picture
    fits its own."""
    for name, own in kept.fits.items():
        rival, lead = scene.drawings.get(name), kept.lead(name, RIVAL_LEAD)
        if rival is None or lead is None or (lead == BESIDE_LEAD and rival.px < BESIDE_PX):
            continue
        least_px = min(rival.px, kept.scene.drawings[name].px)
        lead = max(lead, RIVAL_SCATTER / np.sqrt(least_px))
        correlation = rival.correlation(slopes)
        if correlation > RIVAL_SHARE and correlation - own.correlation > lead:
            yield name


def _shows(accused: _Kept, other: _Kept) -> Iterator[str]:
    """Names of the bodies by which a frame's picture shows what another frame's light shows.

    A drawing may fit all pictures of nearly the same view better than the next drawing does. So the two
    frames' pictures must not tell them apart: if each fits its own frame better than the other picture
    does, both are right.
    """
    for name in _better(other.scene, accused.slopes, accused):
        if not other.is_at_fault:
            own, theirs = accused.fits[name].correlation, other.fits[name].correlation
            ours_there = other.scene.drawings[name].correlation(accused.slopes)
            theirs_here = accused.scene.drawings[name].correlation(other.slopes)
            if own + theirs - ours_there - theirs_here > TOLD_APART * (ours_there - own):
                continue
        yield name


def _of(name: str) -> str:
    return f" ({name})" if name else ""


def _why_not(case: Case) -> str | None:
    if case.labels.sun_fraction_target < LEAST_SUNLIGHT:
        return "in eclipse"
    return "blurred by motion" if smear_px(case) > MOST_SMEAR_PX else None


def smear_px(case: Case) -> float:
    """How far the target's vertices in the image move during the exposure, most of them."""
    labels = case.labels
    if not case.has("exposure_s", "v_body_cam_m_s", "omega_body_rad_s", "omega_camera_rad_s"):
        return 0.0
    at, later = (
        case.camera.project(case.target.vertices_m(after_s)) for after_s in (0.0, labels.exposure_s)
    )
    is_seen = np.all((at >= 0) & (at < [case.camera.width_px, case.camera.height_px]), axis=1)
    moved_px = np.linalg.norm(later - at, axis=1)[is_seen]
    moved_px = moved_px[np.isfinite(moved_px)]
    return float(np.percentile(moved_px, MOST_SMEARED)) if len(moved_px) else 0.0
