"""Whether the pictures show what their labels say.

The outline of each body's mask is compared with the edges of the picture (:mod:`outlines`): a picture
that is shifted, mirrored, or of another frame does not fit. Only points that must be seen count: those
whose surface the Sun lights by the labels, and those before something bright. A frame in which too few
of them see an edge, because it is in eclipse, backlit, saturated, too small, or blurred by motion,
proves nothing either way, and is counted as such.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import inside
from posse_core._errors import InputError
from posse_core._evaluation.case import Case
from posse_core._evaluation.outlines import Edges, Fit, Outline, outline_of
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
from posse_core._evaluation.sunlight import sunlit
from posse_core._model.srgb import linear_from_srgb
from posse_core._scenario.sensor import SensorConfig

LEAST_MASK_PX = 15
"""Length of the longer side of a mask below which its outline proves nothing."""
LEAST_SUNLIGHT = 0.3
"""Least share of the Sun's disc that must light the spacecraft."""
GRAZING = 0.1
"""Cosine of the angle between normal and Sun below which a surface is not taken as lit."""
BRIGHT = 0.02
"""Light, as a share of white, before which a dark spacecraft has an edge; of a shorter exposure than one
that shows a white plate in sunlight as white, as much less."""
LEAST_POWER = 7.0
"""Least :attr:`Fit.power` of a body that proves anything."""
OTHER_SHARE, OTHER_SHARE_BEFORE_LIGHT = 0.3, 0.1
"""A picture whose edges fit the outline by less than this share shows something else; clouds behind the
whole of it leave less of a fit."""
SHIFT_PX, SHIFT_GAIN, SHIFT_SHARE, SHIFT_POWER = 2, 1.2, 0.5, 6.0
"""Least shift of a picture that is a fault; how much better, and how well, it must fit with it; and the
least :attr:`Fit.power` of the points that tell it."""
RIVAL_SHARE, RIVAL_LEAD = 0.5, 0.2
"""How well a mirrored picture or another frame's outline must fit, and by how much better."""
MOST_SMEAR_PX = 3.0
"""Motion during the exposure above which the outline of the instant proves nothing."""


@dataclass(frozen=True)
class View:
    """What a frame's picture is compared with: a body.

    Attributes:
        name: of the body.
        is_target: whether it is the target. Another body may look like what it is before, such as a
            mirror before dark panels, so that its edges prove a picture wrong only where they fit
            better elsewhere.
        outline: of its mask.
        lit: (N,) whether the Sun lights the surface at each of its points, as far as the target's own
            shadow is known.
    """

    name: str
    is_target: bool
    outline: Outline
    lit: BoolArray


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


def views_of(case: Case) -> Iterator[View]:
    """The bodies of a frame whose masks are large enough."""
    labels = case.labels
    depth_m = case.truth.get("depth_m")
    if depth_m is None:
        depth_m = case.hits.depth_m
    sun_cam = case.target.R_cam_from_body @ np.array(labels.sun_direction_body)
    for name, body in labels.instances.items():
        if not body.has("mask_rle"):
            continue
        mask = body.mask_rle.mask()
        if _longest_px(mask) < LEAST_MASK_PX:
            continue
        outline = outline_of(mask)
        lit = _cosine_to_sun(case, mask, depth_m, outline, sun_cam) > GRAZING
        if name is None and case.camera.line_time_s == 0:
            lit &= _out_of_shadow(case, outline)
        yield View(name or labels.spacecraft, name is None, outline, lit)


def _longest_px(mask: BoolArray) -> int:
    sides = [np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1)]
    return max(int(np.ptp(side)) + 1 if len(side) else 0 for side in sides)


def _out_of_shadow(case: Case, outline: Outline) -> BoolArray:
    """(N,) whether no part may be between the Sun and what is just inside each point."""
    column, row = _just_inside(outline, case.target.mask.shape).T
    seen = np.flatnonzero(case.hits.face[row, column] >= 0)
    free = np.zeros(len(outline), dtype=bool)
    if len(seen):
        free[seen] = sunlit(case, row[seen], column[seen])[1]
    return free


def _just_inside(outline: Outline, shape: tuple[int, ...]) -> IntArray:
    """(N, 2) column and row of a pixel within the mask (H, W), not at the image's border."""
    at = np.round(outline.uv_px - 2 * outline.outward).astype(np.int64)
    return np.asarray(np.clip(at, 1, np.array(shape[::-1]) - 2))


def _cosine_to_sun(
    case: Case, mask: BoolArray, depth_m: FloatArray, outline: Outline, sun_cam: FloatArray
) -> FloatArray:
    """(N,) cosine of the Sun's angle to the surface just inside each point, by depths of neighbours."""
    at = _just_inside(outline, mask.shape)

    def points_m(du: int, dv: int) -> FloatArray:
        u, v = at[:, 0] + du, at[:, 1] + dv
        z = np.where(mask[v, u] & np.isfinite(depth_m[v, u]), depth_m[v, u], np.nan)
        return case.camera.rays(np.stack([u, v], axis=-1)) * z[:, None]

    middle = points_m(0, 0)

    def along(du: int, dv: int) -> FloatArray:
        """Difference to the neighbour on the side where the depth changes less."""
        ahead, back = points_m(du, dv) - middle, middle - points_m(-du, -dv)
        is_ahead = _flatness(ahead) <= _flatness(back)
        return np.where(is_ahead[:, None], ahead, back)

    normal = np.cross(along(1, 0), along(0, 1))
    normal *= np.where(normal[:, 2:] > 0, -1.0, 1.0)
    length = np.linalg.norm(normal, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.nan_to_num(normal @ sun_cam / length, nan=0.0))


def _flatness(difference: FloatArray) -> FloatArray:
    return np.asarray(np.nan_to_num(np.abs(difference[:, 2]), nan=np.inf))


@dataclass(frozen=True)
class _Kept:
    """A frame whose picture was compared, kept for the next."""

    index: int
    light: Float32Array
    views: list[View]
    shares: dict[str, float]


class PictureChecks:
    """The checks of every picture of a dataset, a result for each."""

    def __init__(self, scenarios: Scenarios) -> None:
        self._scenarios = scenarios
        self._outlines = Result("picture", "edges are where the outlines of the masks are")
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
        views = list(views_of(case))
        noise = noise_of(light)
        if noise > MOST_NOISE:
            self._outlines.checked += 1
            text = f"the picture is noise: neighbours differ by {noise:.2g} of white"
            self._outlines.faults.append(Fault(labels.index, text))
            return
        kept = _Kept(labels.index, light, views, {})
        least_bright = BRIGHT * _exposure_share(case, sensor)
        faults, proven = [], False
        for view in views:
            edges = Edges(light, view.outline, noise)
            bright = (edges.beside > least_bright) & (edges.beside < SATURATED)
            chosen = view.lit | bright
            fit = edges.fit(chosen)
            if fit is None or fit.power < LEAST_POWER:
                continue
            proven = True
            kept.shares[view.name] = fit.share
            fault = self._fault(view, edges, fit, bright, light, noise, least_bright)
            if fault is not None:
                faults.append(f"{fault} (outline of {view.name})")
        self._last = kept
        if not proven:
            self._unproven["too small, dark or bright" if views else "too small"] += 1
            return
        self._outlines.checked += 1
        self._outlines.faults += [Fault(labels.index, text) for text in faults[:1]]

    def _light_faults(self, case: Case, image: AnyArray, sensor: SensorConfig) -> Iterator[str]:
        scenario = self._scenarios.of(case.labels)
        by_sun = scenario is None or scenario.sky.laboratory is None
        yield from brightness_faults(case, image, sensor, by_sun=by_sun)
        if by_sun and image.ndim == 3 and case.has("q_cam_from_body", "t_body_cam_m"):
            colours = self._scenarios.base_colours(case.labels)
            if len(colours) == len(case.parts):
                fault = colour_fault(case, image, sensor, colours)
                if fault is not None:
                    yield fault

    def _fault(
        self,
        view: View,
        edges: Edges,
        fit: Fit,
        bright: BoolArray,
        light: Float32Array,
        noise: float,
        least_bright: float,
    ) -> str | None:
        """What is wrong with a picture that an outline fits so; bright: (N,) points before light."""
        chosen = view.lit | bright
        best_rival, what = 0.0, ""
        for x, y in product((False, True), repeat=2):
            if x or y:
                rival = Edges(light, view.outline.mirrored(light.shape, x, y), noise).fit(chosen)
                if rival is not None and rival.power >= LEAST_POWER and rival.share > best_rival:
                    best_rival = rival.share
                    what = f"is mirrored in {' and '.join('xy'[i] for i, on in enumerate((x, y)) if on)}"
        if self._last is not None:
            other = next((each for each in self._last.views if each.name == view.name), None)
            if other is not None:
                others = Edges(light, other.outline, noise)
                beside = (others.beside > least_bright) & (others.beside < SATURATED)
                rival = others.fit(other.lit | beside)
                if rival is not None and rival.power >= LEAST_POWER and rival.share > best_rival:
                    best_rival, what = rival.share, f"shows frame {self._last.index}"
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
