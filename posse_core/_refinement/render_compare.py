"""The refiner ``render-compare``: draws the spacecraft, compares, corrects, coarse to fine."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._errors import ComponentError, InputError
from posse_core._evaluation.poses import pose_errors
from posse_core._frames import turn_rad
from posse_core._imaging.grey import to_grey
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.refiner import Refinement, Refiner, RefinerSetting
from posse_core._interfaces.trust import ANGLE_RAD, RANGE_SHARE
from posse_core._refinement.descent import covariance
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.prior import is_within
from posse_core._refinement.search import Outcome, Search
from posse_core._refinement.studio import Studio

_LEFT = 0.9
"""What is left of the disagreement must be less than this share of it."""
_LEAST_SHAPE = 0.55
"""Least agreement of outlines and creases alone, and by how much it must rise."""
_SHAPE_RISE = 0.02
_LARGEST_TURN_RAD = np.radians(30)
_LARGEST_SHARE = 0.3
"""A pose found by outlines alone that is farther from its start is not accepted: the turn, and the share
of the range."""
_LEAST_CONFIRMED = 0.5
"""Least agreement at which a start is confirmed near which the search ends."""
_LEAST_CERTAINTY, _SHARE_OF_TRUST = 0.25, 0.5
"""A pose far from its start is accepted if it is at least so certain, and by at least so much of the
greatest trust of a start; and a start is confirmed if what is found near it is at least so certain."""


class RenderCompare(Refiner[RenderCompareOptions]):
    """Compares the image with drawings of the spacecraft, and corrects the pose until they agree."""

    def __init__(self, options: RenderCompareOptions) -> None:
        super().__init__(options)
        self._setting: RefinerSetting | None = None
        self._studio: Studio | None = None

    def open(self, setting: RefinerSetting) -> None:
        """Prepare; renderers are opened when they are first needed."""
        self.close()
        self._setting, self._studio = setting, Studio(setting, self.options.renderer)

    def close(self) -> None:
        """Close the renderers."""
        if self._studio is not None:
            self._studio.close()
        self._setting = self._studio = None

    def refine(
        self,
        image: AnyArray,
        starts: Sequence[PoseEstimate],
        sun_direction_cam: FloatArray | None = None,
        box_px: FloatArray | None = None,
    ) -> Refinement:
        """Refine a pose; see :meth:`posse_core.Refiner.refine`."""
        if self._setting is None or self._studio is None:
            raise ComponentError("render-compare: the refiner is not open")
        camera = self._setting.camera
        if image.shape[:2] != (camera.height_px, camera.width_px):
            raise InputError(
                f"refiner: the image has {image.shape[1]} × {image.shape[0]} pixels and the camera"
                f" {camera.width_px} × {camera.height_px}; give the camera that took it"
            )
        if not starts:
            raise InputError("refiner: there is no start pose")
        end_s = np.inf if self.options.ms is None else time.perf_counter() + self.options.ms / 1000
        search = Search(
            self._setting,
            self._studio,
            to_grey(image),
            sun_direction_cam,
            float(self.options.size_px),
            lambda: time.perf_counter() < end_s,
            box_px,
        )
        lit = search.lit(starts, self.options.least_agreement)
        if lit is not None and lit.agreement >= self.options.least_agreement:
            most = max(start.trust for start in starts)
            least = max(_LEAST_CERTAINTY, _SHARE_OF_TRUST * most)
            is_likely = self._is_near(lit, starts) or lit.certainty >= least
            is_better = is_likely and _has_fallen(lit.before, lit.agreement)
            return self._made(lit, starts, is_better=is_better)
        # Where the Sun is known, a right pose agrees in brightness.
        first = Placement.of(starts[0])
        shape = search.shape(starts[0]) if sun_direction_cam is None else None
        if shape is None:
            outcome = lit
        elif lit is None or _is_plausible(shape, first):
            R, t_m = shape.found.placement
            there = replace(starts[0], R_cam_from_body=R, t_body_cam_m=t_m)
            again = search.lit([there], self.options.least_agreement)
            if again is not None and again.agreement >= self.options.least_agreement:
                before = lit.before if lit is not None else 0.0
                outcome = replace(again, start=0, before=before)
                is_better = _has_fallen(before, again.agreement)
                return self._made(outcome, starts, is_better=is_better)
            return self._made(shape, starts, is_better=_is_plausible(shape, first))
        else:
            outcome = lit
        if outcome is None:
            return Refinement(starts[0], False, 0.0, 0.0)
        return self._made(outcome, starts, is_better=False)

    def _made(self, outcome: Outcome, starts: Sequence[PoseEstimate], *, is_better: bool) -> Refinement:
        """The outcome as it is returned."""
        assert self._setting is not None
        pose, is_near = starts[outcome.start], self._is_near(outcome, starts)
        agreements = float(outcome.agreement), float(outcome.before)
        found, radius_m = outcome.found, self._setting.spacecraft.radius_m
        C = covariance(found, radius_m) if is_better else None
        if C is None:
            is_first = pose.trust == max(start.trust for start in starts)
            is_sure = outcome.agreement >= _LEAST_CONFIRMED and outcome.certainty >= _LEAST_CERTAINTY
            is_confirmed = is_near and is_first and is_sure
            return Refinement(pose, False, *agreements, is_confirmed)
        R, t = found.placement
        certainty = max(outcome.certainty, pose.trust) if is_near else outcome.certainty
        pose = replace(pose, R_cam_from_body=R, t_body_cam_m=t, covariance=C, certainty=certainty)
        return Refinement(pose, True, *agreements)

    def _is_near(self, outcome: Outcome, starts: Sequence[PoseEstimate]) -> bool:
        """Whether the pose that was found is where it would be if its start were right."""
        assert self._setting is not None
        start, found = starts[outcome.start], outcome.found.placement
        symmetries = self._setting.spacecraft.symmetries
        e_t, e_q_rad = pose_errors(*Placement.of(start), *found, symmetries)
        is_alike = e_t < RANGE_SHARE and e_q_rad < ANGLE_RAD
        return is_alike or is_within(found, start, symmetries)


def _has_fallen(before: float, after: float) -> bool:
    """Whether an image disagrees clearly less than before."""
    return bool(1 - after < _LEFT * (1 - before))


def _is_plausible(shape: Outcome, first: Placement) -> bool:
    """Whether a pose that was found by outlines alone may be better than the start."""
    R, t = shape.found.placement
    share = np.linalg.norm(t - first.t_body_cam_m) / np.linalg.norm(first.t_body_cam_m)
    return bool(
        shape.agreement >= _LEAST_SHAPE
        and shape.agreement > shape.before + _SHAPE_RISE
        and turn_rad(R, first.R_cam_from_body) < _LARGEST_TURN_RAD
        and share < _LARGEST_SHARE
    )
