"""Keep-out ellipsoid, approach cone and passive safety as half-spaces about a planned path.

An ellipsoid's outside is not convex. At each sample of the path it is replaced by the half-space beyond
the tangent plane below the sample, and the plan is refined about its own path until it holds. A cone is
convex; it is replaced by the pyramid inside it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from posse_core._arrays import FloatArray, IntArray
from posse_core._errors import InputError
from posse_core._guidance.horizon import Horizon
from posse_core._guidance.programme import Rows
from posse_core._interfaces.controller import Cone, ControlProblem

PENALTY = 20.0
"""Cost of a metre within the ellipsoid or outside the cone, m/s."""
_FACETS = 12
"""Of the pyramid; its half angle's tangent is cos(π/12) = 0.966 of the cone's, at the least."""
_NEAR = 1.0
"""Samples count that are nearer to the ellipsoid than this share of its semi-axes, or inside it."""
_MOST_SAMPLES, _DENSE_SAMPLES = 40, 12
"""Of a planned path; so many of the first ones are at the instants of the next impulses."""
_MOST_DRIFTS, _DRIFT_SAMPLES = 8, 20
"""Planned impulses that are checked for passive safety: the next one, and then the largest; and samples
of the motion after each."""
_MOST_BULGE = 0.2
_UNSEEN_INTERVALS = 2
_NEAR_TERM = 2 / 3
_RAMP_S = 60.0
_OPPOSITE = 0.2
_TINY = 1e-6


def check_safety(problem: ControlProblem) -> None:
    """Refuse waypoints where the chaser may not be.

    Raises:
        InputError: a waypoint is inside the keep-out ellipsoid, or outside the cone and nearer than its
            length.
    """
    keep_out_m, cone = problem.safety.keep_out_m, problem.safety.cone
    for number, waypoint in enumerate(problem.waypoints, 1):
        r = waypoint.r_rtn_m
        if keep_out_m is not None and np.linalg.norm(r / keep_out_m) < 1:
            raise InputError(
                f"waypoint {number} is inside the keep-out ellipsoid; move it, or make the ellipsoid"
                " smaller"
            )
        if cone is not None and _leaves(r, cone):
            raise InputError(
                f"waypoint {number} is outside the approach cone and nearer than its length; move it,"
                " or change the cone"
            )


def _leaves(r_rtn_m: FloatArray, cone: Cone) -> bool:
    distance = float(np.linalg.norm(r_rtn_m))
    along = float(r_rtn_m @ cone.axis_rtn)
    return distance < cone.length_m and along < np.cos(cone.half_angle_rad) * distance


@dataclass(frozen=True)
class _Samples:
    """K places on a planned path.

    Attributes:
        horizon: the motion.
        t_s: (K,) instants.
        last: (K,) number of the last impulse before each.
        r_rtn_m: (K, 3) positions.
        spread_m2: (K, 3, 3) covariance of the position.
        sigmas: (K,) how many standard deviations are kept from a wall.
    """

    horizon: Horizon
    t_s: FloatArray
    last: IntArray
    r_rtn_m: FloatArray
    spread_m2: FloatArray
    sigmas: FloatArray


class Walls:
    """The half-spaces that a plan is to respect.

    Args:
        problem: for the safety and the thrusters' errors.
        margin_sigma: how many standard deviations of the predicted position are kept from each wall.
        least_m_s: smaller impulses are not made.
    """

    def __init__(self, problem: ControlProblem, margin_sigma: float, least_m_s: float) -> None:
        self._safety, self._thrusters = problem.safety, problem.thrusters
        self._margin, self._least_m_s = margin_sigma, least_m_s

    def rows(self, horizon: Horizon, dv_m_s: FloatArray, covariance: FloatArray) -> Rows | None:
        """The half-spaces about the path with the impulses (N, 3); None if none is near.

        Args:
            horizon: the motion.
            dv_m_s: (N, 3) the impulses.
            covariance: (6, 6) of the state's error, m and m/s.
        """
        keep_out_m, cone = self._safety.keep_out_m, self._safety.cone
        found: list[Rows | None] = []
        if len(horizon.burns_s) > 1 and (keep_out_m is not None or cone is not None):
            path = self._path(horizon, dv_m_s, covariance)
            if keep_out_m is not None:
                found.append(_outside(path, keep_out_m))
            if cone is not None:
                found.append(_inside(path, cone))
        if keep_out_m is not None and self._safety.passive_s > 0:
            drifts = self._drifts(horizon, dv_m_s, covariance)
            found += [_outside(drift, keep_out_m) for drift in drifts]
        parts = [part for part in found if part is not None]
        return Rows.joined(parts) if parts else None

    def _path(self, horizon: Horizon, dv_m_s: FloatArray, covariance: FloatArray) -> _Samples:
        """The planned path at the instants of later impulses, thinned.

        The position is better known again when the next impulse is decided, so its covariance grows over
        two intervals only. An impulse that is too small to be made counts as an error of the velocity.
        In the first minute the margin is smaller: what is a little nearer than the whole margin is led
        away gently.
        """
        t_s = horizon.burns_s[1:]
        if len(t_s) > _MOST_SAMPLES:
            spread = np.geomspace(_DENSE_SAMPLES, len(t_s) - 1, _MOST_SAMPLES - _DENSE_SAMPLES)
            t_s = t_s[np.unique(np.concatenate([np.arange(_DENSE_SAMPLES), spread.astype(np.int64)]))]
        unseen_s = _UNSEEN_INTERVALS * (t_s[0] - horizon.t_s)
        lead = np.clip((t_s - horizon.t_s) / _RAMP_S, 0, 1)
        unmade = np.diag(np.repeat([0.0, self._least_m_s**2], 3))
        return _Samples(
            horizon,
            t_s,
            horizon.last(t_s),
            horizon.path(dv_m_s, t_s)[:, :3],
            self._spread(
                horizon, np.minimum(t_s - horizon.t_s, unseen_s), covariance + unmade, dv_m_s[0]
            ),
            self._margin * (_NEAR_TERM + (1 - _NEAR_TERM) * lead),
        )

    def _drifts(
        self, horizon: Horizon, dv_m_s: FloatArray, covariance: FloatArray
    ) -> Iterator[_Samples]:
        """Each motion that follows if an impulse is the last one.

        The state is assumed to be known then as well as it is now.
        """
        sizes = np.linalg.norm(dv_m_s, axis=1)
        sizes[0] = np.inf
        largest = np.argsort(-sizes, kind="stable")[:_MOST_DRIFTS]
        after_s = np.linspace(0, self._safety.passive_s, _DRIFT_SAMPLES + 1)[1:]
        for burn in largest[sizes[largest] > 0]:
            t_s = horizon.burns_s[burn] + after_s
            alone = dv_m_s.copy()
            alone[burn + 1 :] = 0
            yield _Samples(
                horizon,
                t_s,
                np.full(len(t_s), burn),
                horizon.path(alone, t_s)[:, :3],
                self._spread(horizon, after_s, covariance, dv_m_s[burn]),
                np.full(len(t_s), self._margin),
            )

    def _spread(
        self, horizon: Horizon, after_s: FloatArray, covariance: FloatArray, dv_m_s: FloatArray
    ) -> FloatArray:
        """(K, 3, 3) covariance of the position some time after a state and an impulse (3,).

        The larger error of the impulse is counted in all directions.
        """
        sigma = max(self._thrusters.size, self._thrusters.direction_rad) * np.linalg.norm(dv_m_s)
        error = covariance + np.diag(np.repeat([0.0, sigma**2], 3))
        phi = horizon.motion.transition(horizon.t_s + after_s)[:, :3]
        return np.asarray(np.einsum("kij,jl,kml->kim", phi, error, phi))


def _outside(samples: _Samples, semi_axes_m: FloatArray) -> Rows | None:
    """Half-spaces beyond tangent planes of the ellipsoid, for the samples near to it.

    Between two samples that touch the unit sphere at a distance ℓ, a straight path is up to ℓ²/8 within
    it, and the samples stay that much farther out.
    """
    scaled = samples.r_rtn_m / semi_axes_m
    steps = np.linalg.norm(np.diff(scaled, axis=0), axis=1)
    longest = np.maximum(np.append(steps, 0), np.insert(steps, 0, 0))
    bulge = np.minimum(longest**2 / 8, _MOST_BULGE)
    normals = _outward(scaled) / semi_axes_m
    sigma = np.sqrt(np.einsum("ki,kij,kj->k", normals, samples.spread_m2, normals))
    least = 1 + bulge + samples.sigmas * sigma
    near = np.flatnonzero(np.linalg.norm(scaled, axis=1) < least + _NEAR)
    return _half_spaces(samples, near, normals[near], least[near])


def _outward(scaled: FloatArray) -> FloatArray:
    """(K, 3) unit vectors from the centre towards a way around the unit sphere.

    Outside they point to the path itself. Where the path passes through, they turn from where it enters
    to where it leaves, over the direction in the middle of the two.
    """
    size = np.linalg.norm(scaled, axis=1)
    normals = scaled / np.maximum(size, _TINY)[:, None]
    edges = np.flatnonzero(np.diff(size < 1, prepend=False, append=False))
    for enters, leaves in zip(edges[::2], edges[1::2], strict=True):
        if enters > 0 and leaves < len(scaled):
            first, final = normals[enters - 1], normals[leaves]
            middle = _between(first, final, scaled[enters:leaves].mean(axis=0))
            share = np.linspace(-1, 1, leaves - enters + 2)[1:-1, None]
            turned = np.where(share < 0, -share * first, share * final) + (1 - abs(share)) * middle
            normals[enters:leaves] = turned / np.linalg.norm(turned, axis=1)[:, None]
    return np.asarray(normals)


def _between(first: FloatArray, final: FloatArray, inside: FloatArray) -> FloatArray:
    """Unit vector between two others; where they are opposite, on the side where the path is inside."""
    middle = first + final
    if np.linalg.norm(middle) < _OPPOSITE:
        middle = inside - first * (first @ inside)
        if np.linalg.norm(middle) < _TINY:
            middle = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
    return np.asarray(middle / np.linalg.norm(middle))


def _inside(samples: _Samples, cone: Cone) -> Rows | None:
    """The facets of the pyramid inside the cone, for the samples that are nearer than its length.

    Of each sample, the facets count that are no farther from it than from the axis.
    """
    across = np.linalg.svd(cone.axis_rtn[None])[2][1:]
    turns = 2 * np.pi * np.arange(_FACETS) / _FACETS
    slope = np.tan(cone.half_angle_rad) * np.cos(np.pi / _FACETS)
    sideways = np.column_stack([np.cos(turns), np.sin(turns)]) @ across
    facets = slope * cone.axis_rtn - sideways
    near = np.flatnonzero(np.linalg.norm(samples.r_rtn_m, axis=1) < cone.length_m)
    r = samples.r_rtn_m[near]
    sigma = np.sqrt(np.einsum("fi,kij,fj->kf", facets, samples.spread_m2[near], facets))
    least = samples.sigmas[near, None] * sigma
    sample, facet = np.nonzero(r @ facets.T - least < slope * (r @ cone.axis_rtn)[:, None])
    return _half_spaces(samples, near[sample], facets[facet], least[sample, facet])


def _half_spaces(
    samples: _Samples, which: IntArray, normals: FloatArray, least: FloatArray
) -> Rows | None:
    """``normal · r ≥ least`` at (M,) of the samples; the penalty is for a metre along the normal."""
    if not len(which):
        return None
    horizon, t_s = samples.horizon, samples.t_s[which]
    free = horizon.motion.drift(horizon.rtn, t_s)[:, :3]
    transition = horizon.motion.transition(t_s)[:, :3]
    return Rows(
        samples.last[which],
        np.einsum("ki,kij->kj", normals, transition),
        least - np.einsum("ki,ki->k", normals, free),
        np.full(len(t_s), np.inf),
        PENALTY / np.linalg.norm(normals, axis=1),
    )
