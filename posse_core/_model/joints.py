"""Joints of a spacecraft, and the places to which they move its parts.

A *link* is all that moves as one: the body itself is link 0, and joint j carries link j + 1. A link's
own axes are the body's when every joint is at zero; there the vertices of parts are given.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import R_about, rotated
from posse_core._model.joint_curve import JointCurve

JointKind = Literal["revolute", "prismatic", "fixed"]
"""Turning about the axis, sliding along it, or neither."""


@dataclass(frozen=True)
class Joint:
    """A joint that carries parts of a spacecraft. Positions and axes are those with every joint at zero.

    Attributes:
        name: unique within the spacecraft, for example ``wing``.
        kind: how it moves what it carries.
        origin_body_m: (3,) a point on the axis, body axes.
        axis_body: (3,) unit vector of the axis, body axes; positive values turn by the right-hand rule
            or slide along it.
        parent: name of the joint that carries this one; None if the body does.
        limits: least and greatest value, rad or m.
        facing_body: (3,) unit vector that a law which follows the Sun turns towards it, body axes, such
            as the normal of solar cells; None if there is none.
        animations: name of an animation in the spacecraft's file → the joint's value over time.
    """

    name: str
    kind: JointKind
    origin_body_m: FloatArray
    axis_body: FloatArray
    parent: str | None = None
    limits: tuple[float, float] = (-np.inf, np.inf)
    facing_body: FloatArray | None = None
    animations: Mapping[str, JointCurve] = field(default_factory=dict)

    def moved(self, x_m: FloatArray, value: FloatArray) -> FloatArray:
        """Points (..., 3) that the joint carries, moved by its values (...), rad or m; body axes."""
        if self.kind == "revolute":
            return rotated(x_m - self.origin_body_m, self.axis_body, value) + self.origin_body_m
        if self.kind == "prismatic":
            return np.asarray(x_m + np.asarray(value)[..., None] * self.axis_body)
        return x_m

    def pose(self, value: float) -> tuple[FloatArray, FloatArray]:
        """R (3, 3) and t (3,), m, such that :meth:`moved` takes x to R x + t."""
        if self.kind == "revolute":
            R = R_about(self.axis_body, value)
            return R, self.origin_body_m - R @ self.origin_body_m
        along = value if self.kind == "prismatic" else 0.0
        return np.eye(3), along * self.axis_body


@dataclass(frozen=True)
class Articulation:
    """The joints of one body at an instant. Their rates are constant while the shutter is open.

    Attributes:
        joints: J joints, each after the one that carries it.
        values: (J,) rad or m.
        rates: (J,) rad/s or m/s.
    """

    joints: tuple[Joint, ...] = ()
    values: FloatArray = field(default_factory=lambda: np.zeros(0))
    rates: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def links(self) -> int:
        """Number of links: the body's own and one for each joint."""
        return len(self.joints) + 1

    def after(self, after_s: float) -> Articulation:
        """The joints ``after_s`` seconds later, by their rates."""
        return replace(self, values=self.values + after_s * self.rates) if self.joints else self

    def chain(self, link: int) -> Iterator[int]:
        """Indices of the joints that move a link, from its own to the one at the body."""
        names = [joint.name for joint in self.joints]
        index = link - 1
        while index >= 0:
            yield index
            parent = self.joints[index].parent
            index = -1 if parent is None else names.index(parent)

    def in_body(self, x_link_m: FloatArray, link: int, after_s: FloatArray) -> FloatArray:
        """Points of a link, each at its own time: (..., 3) link axes and (...) seconds after the
        instant → (..., 3) body axes."""
        x_m = x_link_m
        for index in self.chain(link):
            x_m = self.joints[index].moved(x_m, self.values[index] + after_s * self.rates[index])
        return x_m

    def poses(self) -> tuple[FloatArray, FloatArray]:
        """R_body_from_link (L, 3, 3) and t_link_body_m (L, 3) of every link."""
        R_body_from_link, t_link_body_m = [np.eye(3)], [np.zeros(3)]
        names = [joint.name for joint in self.joints]
        for joint, value in zip(self.joints, self.values, strict=True):
            carrier = 0 if joint.parent is None else names.index(joint.parent) + 1
            R, t_m = joint.pose(float(value))
            t_link_body_m.append(R_body_from_link[carrier] @ t_m + t_link_body_m[carrier])
            R_body_from_link.append(R_body_from_link[carrier] @ R)
        return np.stack(R_body_from_link), np.stack(t_link_body_m)

    def motion(self, link: int) -> tuple[FloatArray, FloatArray]:
        """(3,) ω, rad/s, and (3,) v, m/s, such that the points x of a link move by ω × x + v relative to
        the body, in body axes."""
        omega_rad_s, v_m_s = np.zeros(3), np.zeros(3)
        R_body_from_link, t_link_body_m = self.poses()
        for index in self.chain(link):
            joint = self.joints[index]
            R = R_body_from_link[index + 1]
            axis_rate = self.rates[index] * (R @ joint.axis_body)
            if joint.kind == "revolute":
                centre_m = R @ joint.origin_body_m + t_link_body_m[index + 1]
                omega_rad_s = omega_rad_s + axis_rate
                v_m_s = v_m_s - np.cross(axis_rate, centre_m)
            elif joint.kind == "prismatic":
                v_m_s = v_m_s + axis_rate
        return omega_rad_s, v_m_s


RIGID = Articulation()
"""No joint moves."""
