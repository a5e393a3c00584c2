"""Whether the pictures show what their labels say.

The outline of each body's mask is compared with the edges of the picture (:mod:`outlines`): a picture
that is shifted, mirrored, or of another frame does not fit. Only points that must be seen count: those
whose surface the Sun lights by the labels, and those before something bright. What the Sun shows of the
bodies is compared too (:mod:`drawings`), with the picture, its mirror images and those of the frames
beside. A frame in which too little is seen, because it is in eclipse, backlit, saturated, too small, or
blurred by motion, proves nothing either way, and is counted as such.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, Float32Array
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import inside
from posse_core._errors import InputError
from posse_core._evaluation.case import Case
from posse_core._evaluation.drawings import Drawing, DrawingFit, drawing_of
from posse_core._evaluation.outlines import Edges, Fit
from posse_core._evaluation.photometry import (
    MOST_NOISE,
    SATURATED,
    brightness_faults,
    colour_fault,
    format_faults,
    white_share_s,
)
from posse_core._evaluation.result import Fault, Result
from posse_core._evaluation.scenarios import Scenarios
from posse_core._evaluation.views import View, views_of
from posse_core._model.srgb import linear_from_srgb
from posse_core._scenario.model import Scenario
from posse_core._scenario.sensor import SensorConfig

LEAST_SUNLIGHT = 0.3
"""Least share of the Sun's disc that must light the spacecraft."""
BRIGHT = 0.02
"""Light, as a share of white, before which a dark spacecraft has an edge; of a shorter exposure than one
that shows a white plate in sunlight as white, as much less."""
LEAST_POWER = 4.5
"""Least :attr:`Fit.power` of a body that proves anything."""
OTHER_SHARE, OTHER_SHARE_BEFORE_LIGHT = 0.3, 0.1
"""A picture whose edges fit the outline by less than this share shows something else; clouds behind the
whole of it leave less of a fit."""
SHIFT_PX, SHIFT_GAIN, SHIFT_SHARE, SHIFT_POWER = 2, 1.2, 0.5, 6.0
"""Least shift of a picture that is a fault; how much better, and how well, it must fit with it; and the
least :attr:`Fit.power` of the points that tell it."""
RIVAL_SHARE, RIVAL_LEAD = 0.5, 0.2
"""How well a mirrored picture or another frame's outline must fit, and by how much better."""
DRAWN_LEAST = 0.2
"""A picture that correlates less with what the Sun shows is of something else, unless the target's
outline fits."""
DRAWN_BEST, DRAWN_LEAD, DRAWN_GAIN = 0.4, 0.1, 0.04
"""Least correlation of a mirrored or shifted picture, or of another frame; and by how much more it must
be than the picture's own, for these and for a shift."""
MIRRORED = ((True, False), (False, True), (True, True))
"""Axes x and y in which a picture may be mirrored."""
MOST_SMEAR_PX = 3.0
"""Motion during the exposure above which the outline of the instant proves nothing."""


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


@dataclass(frozen=True)
class Subject:
    """What the picture of a frame is compared with, by its labels.

    Attributes:
        views: the bodies whose masks are large enough.
        drawing: what the Sun shows of the bodies; None where that is too little.
    """

    views: tuple[View, ...]
    drawing: Drawing | None


@dataclass
class _Kept:
    """A frame whose picture was compared, kept for the next; drawn is how its own drawing fits."""

    index: int
    light: Float32Array
    subject: Subject
    drawn: DrawingFit | None = None
    is_at_fault: bool = False


class PictureChecks:
    """The checks of every picture of a dataset, a result for each."""

    def __init__(self, scenarios: Scenarios) -> None:
        self._scenarios = scenarios
        self._outlines = Result("picture", "edges and shading are where the labels have them")
        self._light = Result(
            "light", "pictures are as bright, and as coloured, as sensor and Sun make them"
        )
        self._unproven: Counter[str] = Counter()
        self._last: _Kept | None = None

    @property
    def results(self) -> tuple[Result, ...]:
        """What was found so far; frames that prove nothing are not counted as checked, but told."""
        if self._unproven:
            reasons = ", ".join(f"{count} {why}" for why, count in sorted(self._unproven.items()))
            self._outlines.proves = (
                f"{self._outlines.proves.split('; ')[0]}; not to be proven: {reasons}"
            )
        return self._outlines, self._light

    def check(self, case: Case) -> None:
        """Check the picture of a frame whose label line is right."""
        try:
            image = read_image(inside(case.dataset.folder, case.labels.image))
        except InputError:
            return  # said by ``files``
        self.compare(case, image)

    def subject(self, case: Case) -> Subject:
        """What a frame's picture is compared with."""
        scenario = self._scenarios.of(case.labels)
        if scenario is None or not _is_by_sun(scenario):  # the light is not known
            return Subject(tuple(views_of(case)), None)
        colours = self._scenarios.base_colours(case.labels)
        reflectance = np.array([colour.mean() for colour in colours])
        if len(reflectance) != len(case.parts):
            reflectance = np.ones(len(case.parts))
        return Subject(tuple(views_of(case)), drawing_of(case, reflectance))

    def compare(self, case: Case, image: AnyArray) -> None:
        """Check a frame's picture (H, W) or (H, W, 3), uint8 or uint16."""
        labels = case.labels
        if image.shape[:2] != (case.camera.height_px, case.camera.width_px):
            return
        sensor = self._scenarios.sensor(labels)
        self._light.checked += 1
        if sensor is not None:
            wrong = list(format_faults(image, sensor))
            wrong = wrong or list(self._light_faults(case, image, sensor))
            self._light.faults += [Fault(labels.index, text) for text in wrong]
        if not case.has("mask_rle", "q_cam_from_body", "t_body_cam_m", "sun_direction_body"):
            return
        light = light_of(image, "linear" if sensor is None else sensor.response)
        why = _why_not(case)
        if why is not None:
            self._unproven[why] += 1
            return
        subject = self.subject(case)
        noise = noise_of(light)
        if noise > MOST_NOISE:
            self._outlines.checked += 1
            text = f"the picture is noise: neighbours differ by {noise:.2g} of white"
            self._outlines.faults.append(Fault(labels.index, text))
            return
        kept, last = _Kept(labels.index, light, subject), self._last
        self._last = kept
        least_bright = BRIGHT * _exposure_share(case, sensor)
        faults, is_proven, is_like_target = [], False, False
        for view in subject.views:
            edges = Edges(light, view.outline, noise)
            bright = (edges.beside > least_bright) & (edges.beside < SATURATED)
            fit = edges.fit(view.lit | bright)
            if fit is None or fit.power < LEAST_POWER:
                continue
            is_proven = True
            is_like_target |= view.is_target and fit.share > RIVAL_SHARE
            fault = _outline_fault(view, edges, fit, bright, kept, last, noise, least_bright)
            if fault is not None:
                faults.append(f"{fault} (outline of {view.name})")
        if subject.drawing is not None:
            kept.drawn = subject.drawing.fit(light)
        if kept.drawn is not None:
            is_proven = True
            faults += _drawn_faults(kept, last, is_like_target)
        if not is_proven:
            self._unproven["too small, dark or bright" if subject.views else "too small"] += 1
            return
        self._outlines.checked += 1
        if last is not None and not last.is_at_fault and _shows(last, kept):
            text = f"the picture shows frame {kept.index}: what the Sun shows then fits it better"
            self._outlines.faults.append(Fault(last.index, text))
        kept.is_at_fault = bool(faults)
        self._outlines.faults += [Fault(labels.index, text) for text in faults[:1]]

    def _light_faults(self, case: Case, image: AnyArray, sensor: SensorConfig) -> Iterator[str]:
        by_sun = _is_by_sun(self._scenarios.of(case.labels))
        yield from brightness_faults(case, image, sensor, by_sun=by_sun)
        if by_sun and image.ndim == 3 and case.has("q_cam_from_body", "t_body_cam_m"):
            colours = self._scenarios.base_colours(case.labels)
            if len(colours) == len(case.parts):
                fault = colour_fault(case, image, sensor, colours)
                if fault is not None:
                    yield fault


def _is_by_sun(scenario: Scenario | None) -> bool:
    """Whether the Sun is the brightest light, and not the light boxes of a laboratory."""
    return scenario is None or scenario.sky.laboratory is None


def _outline_fault(
    view: View,
    edges: Edges,
    fit: Fit,
    bright: BoolArray,
    kept: _Kept,
    last: _Kept | None,
    noise: float,
    least_bright: float,
) -> str | None:
    """What is wrong with a picture that an outline fits so; bright: (N,) points before light."""
    chosen, light = view.lit | bright, kept.light
    best_rival, what = 0.0, ""
    for x, y in MIRRORED:
        rival = Edges(light, view.outline.mirrored(light.shape, x, y), noise).fit(chosen)
        if rival is not None and rival.power >= LEAST_POWER and rival.share > best_rival:
            best_rival, what = rival.share, _mirrored(x, y)
    if last is not None:
        other = next((each for each in last.subject.views if each.name == view.name), None)
        if other is not None:
            others = Edges(light, other.outline, noise)
            beside = (others.beside > least_bright) & (others.beside < SATURATED)
            rival = others.fit(other.lit | beside)
            if rival is not None and rival.power >= LEAST_POWER and rival.share > best_rival:
                best_rival, what = rival.share, f"shows frame {last.index}"
    if best_rival > RIVAL_SHARE and best_rival - fit.share > RIVAL_LEAD:
        return f"the picture {what}: its edges fit that better"
    # Before clouds, and where the spacecraft is thin, another edge may be the stronger one.
    moved = edges.fit(view.lit & view.outline.deep)
    if (
        moved is not None
        and moved.power >= SHIFT_POWER
        and max(abs(shift) for shift in moved.shift_px) >= SHIFT_PX
        and moved.gain > SHIFT_GAIN
        and moved.best > SHIFT_SHARE
    ):
        return f"the picture is shifted by {moved.shift_px} px"
    before_light = float((bright & chosen).sum() / chosen.sum())
    least = OTHER_SHARE + before_light * (OTHER_SHARE_BEFORE_LIGHT - OTHER_SHARE)
    if view.is_target and fit.share < least:
        return f"the picture shows something else: its edges fit by {max(fit.share, 0):.0%}"
    return None


def _mirrored(x: bool, y: bool) -> str:
    return f"is mirrored in {' and '.join('xy'[i] for i, on in enumerate((x, y)) if on)}"


def _drawn_faults(kept: _Kept, last: _Kept | None, is_like_target: bool) -> Iterator[str]:
    """What is wrong with a picture that the drawing of its labels fits as it does; is_like_target:
    the target's outline is there, and so is not something else."""
    drawing, drawn, light = kept.subject.drawing, kept.drawn, kept.light
    if drawing is None or drawn is None:
        return
    for x, y in MIRRORED:
        mirror = light[:: -1 if y else 1, :: -1 if x else 1]
        if _is_better(drawing.fit(np.ascontiguousarray(mirror)), drawn):
            yield f"the picture {_mirrored(x, y)}: what the Sun shows fits that better"
    before = None if last is None else last.subject.drawing
    if last is not None and before is not None and _is_better(before.fit(light), drawn):
        yield f"the picture shows frame {last.index}: what the Sun shows then fits it better"
    gain = drawn.best - drawn.correlation
    if drawn.steps >= SHIFT_PX and gain > DRAWN_GAIN and drawn.best > DRAWN_BEST:
        yield f"the picture is shifted by {drawn.shift_px} px"
    if drawn.correlation < DRAWN_LEAST and not is_like_target:
        yield (
            "the picture shows something else: it correlates with what the Sun shows by"
            f" {drawn.correlation:.0%}"
        )


def _is_better(rival: DrawingFit | None, own: DrawingFit) -> bool:
    return (
        rival is not None
        and rival.correlation > DRAWN_BEST
        and rival.correlation - own.correlation > DRAWN_LEAD
    )


def _shows(last: _Kept, kept: _Kept) -> bool:
    """Whether the last picture is explained better by this frame's labels."""
    drawing = kept.subject.drawing
    if drawing is None or last.drawn is None:
        return False
    return _is_better(drawing.fit(last.light), last.drawn)


def _exposure_share(case: Case, sensor: SensorConfig | None) -> float:
    """How bright the exposure shows a white plate in sunlight, at most 1."""
    if sensor is None or not case.has("exposure_s", "solar_flux_w_m2"):
        return 1.0
    white_s = white_share_s(sensor, case.camera, case.labels.solar_flux_w_m2)
    return min(1.0, white_s * case.labels.exposure_s)


def _why_not(case: Case) -> str | None:
    if case.labels.sun_fraction_target < LEAST_SUNLIGHT:
        return "in eclipse"
    return "blurred by motion" if smear_px(case) > MOST_SMEAR_PX else None


def smear_px(case: Case) -> float:
    """How far the target's image moves during the exposure, at most."""
    labels = case.labels
    if not case.has("exposure_s", "v_body_cam_m_s", "omega_body_rad_s", "omega_camera_rad_s"):
        return 0.0
    t_m = np.array(labels.t_body_cam_m)
    turn = case.target.R_cam_from_body @ np.array(labels.omega_body_rad_s)
    radius_m = case.target.size_m / 2
    v_m_s = np.array(labels.v_body_cam_m_s) - np.cross(np.array(labels.omega_camera_rad_s), t_m)
    fastest_m_s = np.linalg.norm(v_m_s) + np.linalg.norm(turn) * radius_m
    distance_m = max(float(t_m[2]) - radius_m, 0.1 * radius_m)
    return float(fastest_m_s * labels.exposure_s / distance_m * case.camera.fx_px)
