"""Rotations, and all changes of axes.

No other module implements one, with three exceptions: precession, nutation and the Earth's rotation,
which come from ERFA; rotations within a plane, such as a texture's; and axes that only one renderer
uses.

Axes:
    ECI   GCRF axes, geocentric.
    RTN   of the target: R outward, N along r × v, T = N × R (the velocity's side).
    LVLH  of the target: V-bar = T, H-bar = −N, R-bar = −R (towards the Earth).
    body  the spacecraft's mesh axes, origin at its centre of mass.
    cam   OpenCV: x right, y down, z forward.
    gl    OpenGL and Blender cameras: x right, y up, z backward.

``R_a_from_b`` converts components in b to components in a: x_a = R_a_from_b x_b. Quaternions are
scalar-first (w, x, y, z), and ``q_a_from_b`` is the same rotation as ``R_a_from_b``: x_a = q x_b q*.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from posse_core._arrays import FloatArray

R_GL_FROM_CAM: FloatArray = np.diag([1.0, -1.0, -1.0])
"""OpenCV camera axes → OpenGL camera axes (its own inverse)."""
R_LVLH_FROM_RTN: FloatArray = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""RTN → LVLH: V-bar = T, H-bar = −N, R-bar = −R."""
for _constant in (R_GL_FROM_CAM, R_LVLH_FROM_RTN):
    _constant.setflags(write=False)


def unit(vectors: FloatArray) -> FloatArray:
    """Normalise vectors: (..., n) → (..., n) of length one.

    Raises:
        ValueError: A vector is zero or not finite.
    """
    vectors = np.asarray(vectors, dtype=np.float64)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not np.all(length > 0) or not np.all(np.isfinite(length)):
        raise ValueError("a vector without a direction has no unit vector")
    return np.asarray(vectors / length)


def R_eci_from_rtn(r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
    """Rotation from an orbit's RTN axes to ECI axes: (..., 3), (..., 3) → (..., 3, 3), columns R, T, N.

    Raises:
        ValueError: Position and velocity are parallel, so the orbit has no plane.
    """
    radial = unit(r_eci_m)
    normal = unit(np.cross(r_eci_m, v_eci_m_s))
    return np.stack([radial, np.cross(normal, radial), normal], axis=-1)


def rtn_rate_rad_s(r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
    """Angular velocity (...,) of the RTN axes about N, |r × v| / r²."""
    h = np.linalg.norm(np.cross(r_eci_m, v_eci_m_s), axis=-1)
    return np.asarray(h / np.sum(np.asarray(r_eci_m) ** 2, axis=-1))


def rtn_spin_rad_s(
    r_eci_m: FloatArray, v_eci_m_s: FloatArray, plane_turn_rad_s: FloatArray | float = 0.0
) -> FloatArray:
    """Angular velocity (..., 3) of the RTN axes, in RTN components.

    Args:
        r_eci_m, v_eci_m_s: (..., 3) of the target.
        plane_turn_rad_s: (...) rate at which a force turns the orbit's plane about R; 0 for two bodies.
    """
    about_n = rtn_rate_rad_s(r_eci_m, v_eci_m_s)
    about_r = np.broadcast_to(plane_turn_rad_s, about_n.shape)
    return np.stack([about_r, np.zeros_like(about_n), about_n], axis=-1)


def by_plane_turn(plane_turn_rad_s: FloatArray | float, r_rtn_m: FloatArray) -> FloatArray:
    """Velocities (..., 3) that a turn of the orbit's plane (...) about R gives to positions (..., 3)
    that rest in the RTN axes, in RTN components."""
    turn = np.asarray(plane_turn_rad_s)
    x, y, z = np.moveaxis(r_rtn_m, -1, 0)
    return np.stack([np.zeros_like(x), -turn * z, turn * y], axis=-1)


def eci_from_rtn(
    r_target_eci_m: FloatArray,
    v_target_eci_m_s: FloatArray,
    r_rtn_m: FloatArray,
    v_rtn_m_s: FloatArray,
    plane_turn_rad_s: FloatArray | float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Convert the chaser's RTN state (velocity in the rotating axes) to ECI; all (..., 3), but the turn
    of the plane (...), as in :func:`rtn_spin_rad_s`."""
    R = R_eci_from_rtn(r_target_eci_m, v_target_eci_m_s)
    omega = rtn_spin_rad_s(r_target_eci_m, v_target_eci_m_s, plane_turn_rad_s)
    r = r_target_eci_m + _apply(R, r_rtn_m)
    v = v_target_eci_m_s + _apply(R, v_rtn_m_s + np.cross(omega, r_rtn_m))
    return r, v


def rtn_from_eci(
    r_target_eci_m: FloatArray,
    v_target_eci_m_s: FloatArray,
    r_chaser_eci_m: FloatArray,
    v_chaser_eci_m_s: FloatArray,
    plane_turn_rad_s: FloatArray | float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Convert the chaser's ECI state to RTN (velocity in the rotating axes); all (..., 3), but the turn
    of the plane (...), as in :func:`rtn_spin_rad_s`."""
    R = np.swapaxes(R_eci_from_rtn(r_target_eci_m, v_target_eci_m_s), -1, -2)
    r_rtn_m = _apply(R, r_chaser_eci_m - r_target_eci_m)
    omega = rtn_spin_rad_s(r_target_eci_m, v_target_eci_m_s, plane_turn_rad_s)
    v_rtn_m_s = _apply(R, v_chaser_eci_m_s - v_target_eci_m_s) - np.cross(omega, r_rtn_m)
    return r_rtn_m, v_rtn_m_s


def relative_rtn_from_eci(
    r_target_eci_m: FloatArray, v_target_eci_m_s: FloatArray, plane_turn_rad_s: float = 0.0
) -> FloatArray:
    """Matrix (6, 6) that takes a chaser's position and velocity minus the target's, ECI axes, to its RTN
    position and velocity (in the rotating axes); from the target's state, (3,) and (3,), and the turn
    of its plane, as in :func:`rtn_spin_rad_s`."""
    R = R_eci_from_rtn(r_target_eci_m, v_target_eci_m_s).T
    spin = rtn_spin_rad_s(r_target_eci_m, v_target_eci_m_s, plane_turn_rad_s)
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = matrix[3:, 3:] = R
    matrix[3:, :3] = -cross_matrix(spin) @ R
    return matrix


def _apply(R: FloatArray, x: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("...ij,...j->...i", R, x))


def matrix_from_quaternion(q: FloatArray) -> FloatArray:
    """(..., 4) unit quaternions, scalar first → (..., 3, 3)."""
    w, x, y, z = np.moveaxis(unit(q), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_matrix(R: FloatArray) -> FloatArray:
    """(..., 3, 3) rotation matrices → (..., 4) unit quaternions, scalar first, w ≥ 0.

    By Shepperd (1978): the largest component is computed first, so the result is accurate near 180° too.
    """
    R = np.asarray(R, dtype=np.float64)
    trace = np.trace(R, axis1=-2, axis2=-1)
    # Row k is the quaternion times 4 q_k; the row with the largest q_k is the accurate one.
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    wx, wy, wz = (
        R[..., 2, 1] - R[..., 1, 2],
        R[..., 0, 2] - R[..., 2, 0],
        R[..., 1, 0] - R[..., 0, 1],
    )
    xy, xz, yz = (
        R[..., 0, 1] + R[..., 1, 0],
        R[..., 0, 2] + R[..., 2, 0],
        R[..., 1, 2] + R[..., 2, 1],
    )
    candidates = np.stack(
        [
            np.stack([1 + trace, wx, wy, wz], axis=-1),
            np.stack([wx, 1 + 2 * xx - trace, xy, xz], axis=-1),
            np.stack([wy, xy, 1 + 2 * yy - trace, yz], axis=-1),
            np.stack([wz, xz, yz, 1 + 2 * zz - trace], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    q = unit(np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :])
    return np.where(q[..., :1] < 0, -q, q)


def R_a_from_b_by_directions(
    first_a: FloatArray, second_a: FloatArray, first_b: FloatArray, second_b: FloatArray
) -> FloatArray:
    """Rotation (..., 3, 3) that aligns two pairs of directions, the first exactly.

    It takes ``first_b`` onto ``first_a`` and ``second_b`` as near to ``second_a`` as possible. All
    arguments are (..., 3), of any length (TRIAD; Black 1964).

    Raises:
        ValueError: A pair is parallel, so the rotation about it is undetermined.
    """

    def triad(first: FloatArray, second: FloatArray) -> FloatArray:
        x = unit(first)
        z = unit(np.cross(first, second))
        return np.stack([x, np.cross(z, x), z], axis=-1)

    return np.asarray(triad(first_a, second_a) @ np.swapaxes(triad(first_b, second_b), -1, -2))


def matrix_from_rotation_vector(rotation_rad: FloatArray) -> FloatArray:
    """Rotation (..., 3, 3) by rotation vectors (..., 3), which are axis times angle, right-handed."""
    half = np.linalg.norm(rotation_rad, axis=-1, keepdims=True) / 2
    # numpy's sinc is sin(πx)/(πx); it is 1 at 0, so a zero rotation is no special case.
    q = np.concatenate([np.cos(half), np.sinc(half / np.pi) / 2 * rotation_rad], axis=-1)
    return matrix_from_quaternion(q)


def right_jacobian(rotation_rad: FloatArray) -> FloatArray:
    """Derivative (3, 3) of a rotation by its rotation vector φ (3,): exp((φ + ε)×) is
    exp(φ×) exp((J ε)×) to first order (Chirikjian 2011, Stochastic Models 2, section 10.6)."""
    square = float(rotation_rad @ rotation_rad)
    X = cross_matrix(rotation_rad)
    if square < 1e-6:
        return np.asarray(np.eye(3) - (0.5 - square / 24) * X + (1 / 6 - square / 120) * X @ X)
    angle = math.sqrt(square)
    first, second = (1 - math.cos(angle)) / square, (angle - math.sin(angle)) / (square * angle)
    return np.asarray(np.eye(3) - first * X + second * X @ X)


def cross_matrix(x: FloatArray) -> FloatArray:
    """Matrix of the cross product, (..., 3) → (..., 3, 3): ``cross_matrix(x) @ y`` is x × y."""
    a, b, c = np.moveaxis(np.asarray(x, dtype=np.float64), -1, 0)
    zero = np.zeros_like(a)
    rows = [[zero, -c, b], [c, zero, -a], [-b, a, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def R_eci_from_perifocal(raan_rad: float, i_rad: float, argp_rad: float) -> FloatArray:
    """Rotation (3, 3) from perifocal axes (x towards perigee, z along the orbit's normal) to ECI axes.

    It is R₃ᵀ(Ω) R₁ᵀ(i) R₃ᵀ(ω).
    """
    cO, sO, ci, si = math.cos(raan_rad), math.sin(raan_rad), math.cos(i_rad), math.sin(i_rad)
    cw, sw = math.cos(argp_rad), math.sin(argp_rad)
    third = np.array([[cO, -sO, 0], [sO, cO, 0], [0, 0, 1]])
    first = np.array([[1, 0, 0], [0, ci, -si], [0, si, ci]])
    inner = np.array([[cw, -sw, 0], [sw, cw, 0], [0, 0, 1]])
    return np.asarray(third @ first @ inner)


def turn_rad(R_a: FloatArray, R_b: FloatArray) -> float:
    """The angle of the turn between two rotations (3, 3), 0 … π rad."""
    R = np.asarray(R_a).T @ np.asarray(R_b)
    sine = np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.arctan2(sine, np.trace(R) - 1))


def R_about(axis: ArrayLike, angle_rad: float) -> FloatArray:
    """Rotation (3, 3) about an axis (3,) by the right-hand rule."""
    direction = unit(np.asarray(axis, dtype=np.float64))
    return matrix_from_quaternion(np.r_[np.cos(angle_rad / 2), np.sin(angle_rad / 2) * direction])


def R_from_z(direction: ArrayLike, x_hint: ArrayLike = (1.0, 0.0, 0.0)) -> FloatArray:
    """Rotation (3, 3) that takes z to ``direction`` and x as near to ``x_hint`` as possible.

    If the hint is along the direction, y is used in its place.
    """
    z = unit(np.asarray(direction, dtype=np.float64))
    x = np.asarray(x_hint, dtype=np.float64)
    x = x - z * (x @ z)
    if np.linalg.norm(x) < 1e-6:
        x = np.array([0.0, 1.0, 0.0]) - z * z[1]
    x = unit(x)
    return np.column_stack([x, np.cross(z, x), z])


def R_with_z(z: FloatArray) -> FloatArray:
    """Rotations (..., 3, 3) with the unit vector ``z`` (..., 3) as third column, arbitrary otherwise."""
    across = np.eye(3)[np.argmin(np.abs(z), axis=-1)]
    x = unit(np.cross(across, z))
    return np.stack([x, np.cross(z, x), z], axis=-1)


def R_least(before: FloatArray, after: FloatArray) -> FloatArray:
    """Smallest rotation (3, 3) that takes the unit vector ``before`` (3,) to ``after`` (3,)."""
    axis = np.cross(before, after)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return np.eye(3)
    return R_about(axis, float(np.arctan2(sine, before @ after)))


def rotated(x: FloatArray, axis: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Rotate vectors (..., 3) about a unit axis (3,), each by its own angle (...).

    Rodrigues' formula is used, so that the bits of the result do not depend on a BLAS library.
    """
    angle = np.asarray(angle_rad)[..., None]
    along = np.sum(axis * x, axis=-1, keepdims=True)
    cosine = np.cos(angle)
    return np.asarray(x * cosine + np.cross(axis, x) * np.sin(angle) + axis * along * (1 - cosine))


def turned(x: FloatArray, omega_rad_s: FloatArray, after_s: FloatArray) -> FloatArray:
    """Rotate vectors (..., 3) at an angular velocity (3,), each for its own time (...)."""
    rate = float(np.sqrt(np.sum(omega_rad_s * omega_rad_s)))
    if rate == 0 or not np.any(after_s):
        return np.broadcast_to(x, np.broadcast_shapes(x.shape, (*np.shape(after_s), 3)))
    return rotated(x, omega_rad_s / rate, rate * np.asarray(after_s))


def rotation_vector_from_matrix(R: FloatArray) -> FloatArray:
    """Rotation vectors (..., 3), axis times angle, of rotations (..., 3, 3); right-handed, 0 … π."""
    q = quaternion_from_matrix(R)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    return np.asarray(q[..., 1:] * (2 / np.sinc(half / np.pi)))
