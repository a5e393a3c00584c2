"""Keep-out ellipsoid, approach cone and passive safety as half-spaces about a planned path.

An ellipsoid's outside is not convex. At each sample of the path it is replaced by the half-space beyond
the tangent plane below the sample, and the plan is refined about its own path until it holds. A cone is
convex; it is replaced by the pyramid inside it.
"""

from __future__ import annotations

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
_MOST_SAMPLES = 40
_DENSE_SAMPLES = 12
_DRIFT_SAMPLES = 20
_MOST_BULGE = 0.2
_MOST_DRIFTS = 8
"""Planned impulses that are checked for passive safety: the next one, and then the largest."""
_GAPS_BLIND = 2
_NEAR_TERM = 2 / 3
_RAMP_S = 60.0
_BURN_M_S = 1e-6


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


class Walls:
    """The half-spaces that a plan is to respect.

    Args:
        problem: for the safety and the thrusters' errors.
        margin_sigma: how many standard deviations of the predicted position are kept from each wall.
    """

    def __init__(self, problem: ControlProblem, margin_sigma: float) -> None:
        self._safety, self._thrusters = problem.safety, problem.thrusters
        self._margin = margin_sigma

    def rows(self, horizon: Horizon, dv_m_s: FloatArray, covariance: FloatArray) -> Rows | None:
        """The half-spaces about the path with the impulses (N, 3); None if none is near.

        Args:
            horizon: the motion.
            dv_m_s: (N, 3) the impulses.
            covariance: (6, 6) of the state's error, m and m/s.
        """
        parts = []
        t_s = self._samples(horizon)
        if not len(t_s):
            return None
        path = horizon.path(dv_m_s, t_s)[:, :3]
        error = covariance + self._execution(dv_m_s[0])
        blind_s = horizon.t_s + _GAPS_BLIND * (t_s[0] - horizon.t_s)
        phi = horizon.motion.transition(np.minimum(t_s, blind_s))[:, :3]
        spread = np.einsum("kij,jl,kml->kim", phi, error, phi)
        lead = np.clip((t_s - horizon.t_s) / _RAMP_S, 0, 1)
        margin = self._margin * (_NEAR_TERM + (1 - _NEAR_TERM) * lead)
        last = horizon.last(t_s)
        if self._safety.keep_out_m is not None:
            parts.append(_outside(horizon, t_s, last, path, spread, margin, self._safety.keep_out_m))
        if self._safety.cone is not None:
            parts.append(_inside(horizon, t_s, last, path, spread, margin, self._safety.cone))
        if self._safety.keep_out_m is not None and self._safety.passive_s > 0:
            parts += self._drifts(horizon, dv_m_s, error)
        found = [part for part in parts if part is not None]
        return Rows.joined(found) if found else None

    def _samples(self, horizon: Horizon) -> FloatArray:
        """The instants at which the path is compared with the walls: those of impulses, thinned."""
        t_s = horizon.burns_s[1:]
        if len(t_s) <= _MOST_SAMPLES:
            return t_s
        spread = np.geomspace(_DENSE_SAMPLES, len(t_s) - 1, _MOST_SAMPLES - _DENSE_SAMPLES)
        kept = np.unique(np.concatenate([np.arange(_DENSE_SAMPLES), spread.astype(np.int64)]))
        return np.asarray(t_s[kept])

    def _execution(self, dv_m_s: FloatArray) -> FloatArray:
        """(6, 6) covariance that the errors of an impulse add, the larger one in all directions."""
        sigma = max(self._thrusters.size, self._thrusters.direction_rad) * np.linalg.norm(dv_m_s)
        added = np.zeros((6, 6))
        added[3:, 3:] = np.eye(3) * sigma**2
        return added

    def _drifts(self, horizon: Horizon, dv_m_s: FloatArray, error: FloatArray) -> list[Rows | None]:
        """Each motion that follows if an impulse is the last one.

        The state is assumed to be known then as well as it is now.
        """
        assert self._safety.keep_out_m is not None
        sizes = np.linalg.norm(dv_m_s, axis=1)
        sizes[0] = np.inf
        burning = np.argsort(-sizes, kind="stable")[:_MOST_DRIFTS]
        after_s = np.linspace(0, self._safety.passive_s, _DRIFT_SAMPLES + 1)[1:]
        phi = horizon.motion.transition(horizon.t_s + after_s)[:, :3]
        spread = np.einsum("kij,jl,kml->kim", phi, error, phi)
        parts = []
        for burn in burning[sizes[burning] > _BURN_M_S]:
            t_s = horizon.burns_s[burn] + after_s
            alone = dv_m_s.copy()
            alone[burn + 1 :] = 0
            path = horizon.path(alone, t_s)[:, :3]
            last = np.full(len(t_s), burn)
            margin = np.full(len(t_s), self._margin)
            parts.append(_outside(horizon, t_s, last, path, spread, margin, self._safety.keep_out_m))
        return parts


def _outside(
    horizon: Horizon,
    t_s: FloatArray,
    last: IntArray,
    path: FloatArray,
    spread: FloatArray,
    margin: FloatArray,
    semi_axes: FloatArray,
) -> Rows | None:
    """Half-spaces beyond tangent planes of the ellipsoid, for samples (K, 3) near to it.

    Between two samples that touch the unit sphere at a distance ℓ, a straight path is up to ℓ²/8 within
    it, and the samples stay that much farther out.
    """
    scaled = path / semi_axes
    steps = np.linalg.norm(np.diff(scaled, axis=0), axis=1)
    if len(steps):
        longest = np.maximum(np.append(steps, 0), np.insert(steps, 0, 0))
    else:
        longest = np.zeros(len(scaled))
    bulge = np.minimum(longest**2 / 8, _MOST_BULGE)
    normals = _outward(scaled) / semi_axes
    sigma = np.sqrt(np.einsum("ki,kij,kj->k", normals, spread, normals))
    least = 1 + bulge + margin * sigma
    near = np.flatnonzero(np.linalg.norm(scaled, axis=1) < least + _NEAR)
    if not len(near):
        return None
    return _half_spaces(horizon, t_s[near], last[near], normals[near], least[near])


def _outward(scaled: FloatArray) -> FloatArray:
    """(K, 3) unit vectors from the centre towards a way around the unit sphere.

    Outside they point to the path itself. Where the path passes through, they turn evenly from where it
    enters to where it leaves.
    """
    size = np.linalg.norm(scaled, axis=1)
    normals = scaled / np.maximum(size, 1e-9)[:, None]
    inside = size < 1
    edges = np.flatnonzero(np.diff(inside.astype(int), prepend=0, append=0))
    for enters, leaves in zip(edges[::2], edges[1::2], strict=True):
        if enters == 0 or leaves == len(scaled):
            continue
        first, final = normals[enters - 1], normals[leaves]
        middle = first + final
        if np.linalg.norm(middle) < 0.2:  # straight through: sideways, on the side of the path
            middle = scaled[enters:leaves].mean(axis=0)
            middle -= first * (first @ middle)
            if np.linalg.norm(middle) < 1e-3:
                middle = np.cross(first, [0.0, 0.0, 1.0] if abs(first[2]) < 0.9 else [1.0, 0.0, 0.0])
        middle /= np.linalg.norm(middle)
        for k in range(enters, leaves):
            share = 2 * (k - enters + 1) / (leaves - enters + 1)
            one, two = (first, middle) if share < 1 else (middle, final)
            turned = one * (1 - share % 1) + two * (share % 1) if share < 2 else final
            normals[k] = turned / np.linalg.norm(turned)
    return np.asarray(normals)


def _inside(
    horizon: Horizon,
    t_s: FloatArray,
    last: IntArray,
    path: FloatArray,
    spread: FloatArray,
    margin: FloatArray,
    cone: Cone,
) -> Rows | None:
    """The facets of the pyramid inside the cone, for samples (K, 3) that are nearer than its length."""
    axis = cone.axis_rtn
    across = np.linalg.svd(axis[None])[2][1:]
    turns = 2 * np.pi * np.arange(_FACETS) / _FACETS
    slope = np.tan(cone.half_angle_rad) * np.cos(np.pi / _FACETS)
    facets = slope * axis - np.cos(turns)[:, None] * across[0] - np.sin(turns)[:, None] * across[1]
    near = np.flatnonzero(np.linalg.norm(path, axis=1) < cone.length_m)
    if not len(near):
        return None
    sigma = np.sqrt(np.einsum("fi,kij,fj->kf", facets, spread[near], facets))
    least = margin[near, None] * sigma
    sample, facet = np.nonzero(path[near] @ facets.T - least < slope * path[near] @ axis[:, None])
    each = near[sample]
    return _half_spaces(horizon, t_s[each], last[each], facets[facet], least[sample, facet])


def _half_spaces(
    horizon: Horizon, t_s: FloatArray, last: IntArray, normals: FloatArray, least: FloatArray
) -> Rows:
    """``normal · r ≥ least`` at (M,) instants; the penalty is for a metre along the normal."""
    free = horizon.motion.drift(horizon.rtn, t_s)[:, :3]
    transition = horizon.motion.transition(t_s)[:, :3]
    return Rows(
        last,
        np.einsum("ki,kij->kj", normals, transition),
        least - np.einsum("ki,ki->k", normals, free),
        np.full(len(t_s), np.inf),
        PENALTY / np.linalg.norm(normals, axis=1),
    )
