"""The refiner ``render-compare``: draws the spacecraft, compares, corrects, coarse to fine."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._errors import ComponentError, InputError
from posse_core._imaging.grey import to_grey
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.refiner import Refinement, Refiner, RefinerSetting
from posse_core._refinement.acceptance import (
    has_fallen,
    is_confirming,
    is_likely,
    is_plausible,
    left_of_start,
)
from posse_core._refinement.descent import covariance
from posse_core._refinement.follower import Follower
from posse_core._refinement.options import RenderCompareOptions
from posse_core._refinement.placement import Placement
from posse_core._refinement.prior import is_near
from posse_core._refinement.search import Search
from posse_core._refinement.sides import Sides
from posse_core._refinement.studio import Studio
from posse_core._refinement.trail import Outcome


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
        self._sides = Sides(self._studio, setting.spacecraft.radius_m)

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
        follower = Follower(
            self._setting,
            self._studio,
            to_grey(image),
            sun_direction_cam,
            float(self.options.size_px),
            self.options.least_agreement,
            lambda: time.perf_counter() < end_s,
            box_px,
        )
        search = Search(self._setting, follower, self._sides)
        lit = search.lit(starts, from_all_sides=True)
        if lit is not None and lit.agreement >= self.options.least_agreement:
            refined = self._refined(lit, starts)
            most = max(start.trust for start in starts)
            near = starts[lit.start] if self._is_near(lit, starts) else None
            if (
                refined is not None
                and is_likely(refined, lit.certainty, near, most, follower.telling.refused)
                and has_fallen(lit.before, lit.agreement)
            ):
                return Refinement(refined, True, lit.agreement, lit.before)
            return self._refused(lit, starts, lit.certainty, follower.telling.refused)
        # Where the Sun is known, a right pose agrees in brightness.
        shape = follower.shape(starts[0]) if sun_direction_cam is None else None
        if shape is not None:
            first, there = Placement.of(starts[0]), shape.found.placement
            is_better = is_plausible(there, shape.agreement, first, shape.before)
            if is_better or lit is None:
                R, t_m = there
                start = replace(starts[0], R_cam_from_body=R, t_body_cam_m=t_m)
                # Of known materials all that agrees in brightness was seen from all sides before.
                has_seen_all = self._studio.knows_materials
                again = search.lit([start], from_all_sides=not has_seen_all)
                if again is not None and again.agreement >= self.options.least_agreement:
                    before = lit.before if lit is not None else 0.0
                    shape = replace(again, start=0, before=before)
                    is_better = has_fallen(before, again.agreement)
                refined = self._refined(shape, starts) if is_better else None
                if refined is not None:
                    return Refinement(refined, True, shape.agreement, shape.before)
                return self._refused(shape, starts, 0.0, follower.telling.refused)
        if lit is None:
            return Refinement(starts[0], False, 0.0, 0.0, follower.telling.refused)
        return self._refused(lit, starts, lit.certainty, follower.telling.refused)

    def _refined(self, outcome: Outcome, starts: Sequence[PoseEstimate]) -> PoseEstimate | None:
        """The pose that was found; None where the image does not determine it."""
        assert self._setting is not None
        C = covariance(outcome.found, self._setting.spacecraft.radius_m)
        if C is None:
            return None
        (R, t), start = outcome.found.placement, starts[outcome.start]
        is_near = self._is_near(outcome, starts)
        of_start = start.trust * outcome.certainty_among if is_near else 0.0
        certainty = max(outcome.certainty, of_start)
        return replace(start, R_cam_from_body=R, t_body_cam_m=t, covariance=C, certainty=certainty)

    def _refused(
        self, outcome: Outcome, starts: Sequence[PoseEstimate], certainty: float, least: float
    ) -> Refinement:
        """The start, of which an outcome was not accepted.

        Args:
            certainty: of the pose that was found, which counts against a start that is far from it.
            least: what is left of the certainty of a start that was not confirmed, without that.
        """
        assert self._setting is not None
        start, symmetries = starts[outcome.start], self._setting.spacecraft.symmetries
        is_first = start.trust == max(each.trust for each in starts)
        is_sure = is_confirming(outcome.agreement, outcome.certainty)
        if is_first and is_sure and self._is_near(outcome, starts):
            left = 1.0
        elif is_near(outcome.found.placement, starts[0], symmetries):
            left = least
        else:
            left = left_of_start(certainty, least)
        return Refinement(start, False, outcome.agreement, outcome.before, left)

    def _is_near(self, outcome: Outcome, starts: Sequence[PoseEstimate]) -> bool:
        """Whether the pose that was found is where it would be if its start were right."""
        assert self._setting is not None
        symmetries = self._setting.spacecraft.symmetries
        return is_near(outcome.found.placement, starts[outcome.start], symmetries)
