"""A body where its labels say it is: its links are placed by code that made none of the labels.

Rotations are SciPy's. A joint's kinematics are those of ``spacecraft/NAME.json``, as ``docs/labels.md``
describes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._arrays import FloatArray, IntArray
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._model.joints import Joint
from posse_core._model.label_line import JointLabels, JointReading

JointsSaid = Mapping[str, JointLabels | JointReading]
"""Value and rate of each joint that moves, by name."""


@dataclass(frozen=True)
class PlacedBody:
    """A body at one instant, and how it moves on while the shutter is open.

    A link is what a joint moves as one: number 0 is the body's own, j + 1 that of ``craft.joints[j]``.

    Attributes:
        craft: whose joints they are.
        R_cam_from_body: (3, 3).
        t_body_cam_m: (3,).
        omega_body_rad_s, omega_camera_rad_s, v_body_cam_m_s: (3,) rates, as labels have them.
        is_carried: whether it stays where it is in camera axes whatever its rates are.
        joints: a joint that is not there is at zero.
    """

    craft: SpacecraftInfo
    R_cam_from_body: FloatArray
    t_body_cam_m: FloatArray
    omega_body_rad_s: FloatArray
    omega_camera_rad_s: FloatArray
    v_body_cam_m_s: FloatArray
    is_carried: bool = False
    joints: JointsSaid = field(default_factory=dict)

    def in_camera(
        self, x_link_m: FloatArray, links: IntArray, after_s: FloatArray | float = 0.0
    ) -> FloatArray:
        """(N, 3) positions in camera axes after a time.

        Args:
            x_link_m: (N, 3) in the axes of each point's link.
            links: (N,) number of each point's link.
            after_s: after the instant, one for all or (N,).
        """
        after_s = np.asarray(after_s)
        x_m = np.array(x_link_m, dtype=np.float64)
        for rows, chain in self._carried(links):
            for joint in chain:
                x_m[rows] = self._moved(x_m[rows], joint, _of(after_s, rows), 1)
        still = self.is_carried
        if not still:
            x_m = _turn(self.omega_body_rad_s, after_s).apply(x_m)
        x_m = x_m @ self.R_cam_from_body.T + self.t_body_cam_m
        if still:
            return x_m
        x_m += after_s[..., None] * self.v_body_cam_m_s
        return np.asarray(_turn(-self.omega_camera_rad_s, after_s).apply(x_m))

    def in_link(self, x_cam_m: FloatArray, links: IntArray, after_s: FloatArray) -> FloatArray:
        """(N, 3) camera axes, each (N,) after the instant → (N, 3) axes of the links (N,); the inverse
        of :meth:`in_camera`."""
        x_m = np.array(x_cam_m, dtype=np.float64)
        if not self.is_carried:
            x_m = _turn(self.omega_camera_rad_s, after_s).apply(x_m)
            x_m -= after_s[:, None] * self.v_body_cam_m_s
        x_m = (x_m - self.t_body_cam_m) @ self.R_cam_from_body
        if not self.is_carried:
            x_m = _turn(-self.omega_body_rad_s, after_s).apply(x_m)
        for rows, chain in self._carried(links):
            for joint in reversed(chain):
                x_m[rows] = self._moved(x_m[rows], joint, after_s[rows], -1)
        return x_m

    def link_pose(self, link: int) -> tuple[FloatArray, FloatArray]:
        """R_cam_from_link (3, 3) and t_link_cam_m (3,)."""
        corners_m = self.in_camera(np.vstack([np.zeros(3), np.eye(3)]), np.full(4, link))
        return (corners_m[1:] - corners_m[0]).T, corners_m[0]

    def _carried(self, links: IntArray) -> Iterator[tuple[IntArray, list[Joint]]]:
        """The points of each link that joints carry, and these joints, its own first."""
        for link in range(1, len(self.craft.joints) + 1):
            rows = np.flatnonzero(links == link)
            if len(rows):
                yield rows, self._chains[link - 1]

    @cached_property
    def _chains(self) -> list[list[Joint]]:
        """The joints that move each joint's link, its own first."""
        chains: dict[str | None, list[Joint]] = {None: []}
        for joint in self.craft.joints:
            chains[joint.name] = [joint, *chains[joint.parent]]
        return [chains[joint.name] for joint in self.craft.joints]

    def _moved(self, x_m: FloatArray, joint: Joint, after_s: FloatArray, sign: int) -> FloatArray:
        """Points (N, 3) that a joint carries, moved by it, or, with the sign −1, back again."""
        said = self.joints.get(joint.name)
        if said is None or joint.kind == "fixed":
            return x_m
        value = sign * (said.value + said.rate * after_s)
        if joint.kind == "prismatic":
            return np.asarray(x_m + value[..., None] * joint.axis_body)
        turn = _turn(joint.axis_body, value)
        return np.asarray(turn.apply(x_m - joint.origin_body_m) + joint.origin_body_m)


def _turn(rate: FloatArray, amount: FloatArray) -> Rotation:
    """The rotation by a rate (3,) for one amount, or for each of (N,)."""
    return Rotation.from_rotvec(amount[..., None] * rate)


def _of(after_s: FloatArray, rows: IntArray) -> FloatArray:
    return after_s[rows] if after_s.ndim else after_s
