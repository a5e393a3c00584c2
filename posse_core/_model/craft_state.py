"""Where the spacecraft and the other bodies of a scene are at one instant, in camera axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._frames import matrix_from_rotation_vector, turned
from posse_core._model.finish import Finish
from posse_core._model.joints import RIGID, Articulation
from posse_core._model.mount import Mount


@dataclass(frozen=True)
class Rates:
    """Rates of a body and the camera, which are constant while the shutter is open.

    Attributes:
        v_body_cam_m_s: (3,) velocity of the body's origin relative to the camera, measured in GCRF
            axes and given in the camera axes at the frame's instant.
        omega_body_rad_s: (3,) angular velocity of the body relative to GCRF axes, body axes.
        omega_camera_rad_s: (3,) angular velocity of the camera relative to GCRF axes, camera axes.
    """

    v_body_cam_m_s: FloatArray
    omega_body_rad_s: FloatArray
    omega_camera_rad_s: FloatArray

    def relative(
        self, R_cam_from_body: FloatArray, t_body_cam_m: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(3,) ω and (3,) v such that points x of the body move by ω × x + v in camera axes."""
        omega_body_cam_rad_s = R_cam_from_body @ self.omega_body_rad_s
        v_m_s = self.v_body_cam_m_s - np.cross(omega_body_cam_rad_s, t_body_cam_m)
        return omega_body_cam_rad_s - self.omega_camera_rad_s, v_m_s


AT_REST = Rates(*np.zeros((3, 3)))
"""All rates are zero."""


@dataclass(frozen=True)
class BodyState:
    """A body at one instant, in camera axes.

    A *link* is what a joint of the body moves as one (:mod:`posse_core._model.joints`); link 0 is the
    body's own.

    Attributes:
        R_cam_from_body: (3, 3): x_cam = R_cam_from_body x_body + t_body_cam_m.
        t_body_cam_m: (3,) the body's origin in camera axes.
        rates: the rates around the instant.
        articulation: the joints that move.
        is_carried: whether the chaser carries the body, so that it stays where it is in camera axes
            whatever the rates are.
        finishes: key of a material → its factors, of those that vary from frame to frame.
    """

    R_cam_from_body: FloatArray
    t_body_cam_m: FloatArray
    rates: Rates = AT_REST
    articulation: Articulation = RIGID
    is_carried: bool = False
    finishes: Mapping[str, Finish] = field(default_factory=dict)

    def after(self, after_s: float) -> Self:
        """The state ``after_s`` later (or earlier, if negative), by its rates."""
        if after_s == 0:
            return self
        articulation = self.articulation.after(after_s)
        if self.is_carried:
            return replace(self, articulation=articulation)
        rates = self.rates
        R_then_from_now = matrix_from_rotation_vector(-after_s * rates.omega_camera_rad_s)
        R_body_turn = matrix_from_rotation_vector(after_s * rates.omega_body_rad_s)
        return replace(
            self,
            R_cam_from_body=R_then_from_now @ self.R_cam_from_body @ R_body_turn,
            t_body_cam_m=R_then_from_now @ (self.t_body_cam_m + after_s * rates.v_body_cam_m_s),
            articulation=articulation,
        )

    def poses_after(self, after_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """R_cam_from_body (N, 3, 3) and t_body_cam_m (N, 3) of the states :meth:`after` each of (N,)
        seconds."""
        count = len(after_s)
        if self.is_carried:
            return np.tile(self.R_cam_from_body, (count, 1, 1)), np.tile(self.t_body_cam_m, (count, 1))
        rates, times_s = self.rates, after_s[:, None]
        R_then_from_now = matrix_from_rotation_vector(-times_s * rates.omega_camera_rad_s)
        R_body_turn = matrix_from_rotation_vector(times_s * rates.omega_body_rad_s)
        moved_m = self.t_body_cam_m + times_s * rates.v_body_cam_m_s
        t_body_cam_m = (R_then_from_now @ moved_m[:, :, None])[:, :, 0]
        return R_then_from_now @ self.R_cam_from_body @ R_body_turn, t_body_cam_m

    def in_camera(self, x_link_m: FloatArray, after_s: FloatArray, link: int = 0) -> FloatArray:
        """Positions of points of a link, each at its own time: (..., 3) link axes and (...) seconds
        after the instant → (..., 3) camera axes."""
        x_body_m = self.articulation.in_body(x_link_m, link, after_s)
        R, t = self.R_cam_from_body, self.t_body_cam_m
        rates = self.rates
        if not self.is_carried:
            x_body_m = turned(x_body_m, rates.omega_body_rad_s, after_s)
        x, y, z = np.moveaxis(x_body_m, -1, 0)
        x_m = np.stack([row[0] * x + row[1] * y + row[2] * z for row in R], axis=-1) + t
        if self.is_carried:
            return x_m
        x_m = x_m + np.asarray(after_s)[..., None] * rates.v_body_cam_m_s
        return turned(x_m, -rates.omega_camera_rad_s, after_s)

    def link_poses_after(self, link: int, after_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """R_cam_from_link (N, 3, 3) and t_link_cam_m (N, 3), each after its own (N,) seconds."""
        R_cam_from_body, t_body_cam_m = self.poses_after(after_s)
        if link == 0:
            return R_cam_from_body, t_body_cam_m
        corners = np.vstack([np.zeros(3), np.eye(3)])
        moved_m = np.stack(
            [self.articulation.in_body(np.tile(x, (len(after_s), 1)), link, after_s) for x in corners],
            axis=-1,
        )
        R_body_from_link, t_link_body_m = moved_m[:, :, 1:] - moved_m[:, :, :1], moved_m[:, :, 0]
        t_link_cam_m = (R_cam_from_body @ t_link_body_m[:, :, None])[:, :, 0] + t_body_cam_m
        return R_cam_from_body @ R_body_from_link, t_link_cam_m

    def motion(self, link: int = 0) -> tuple[FloatArray, FloatArray]:
        """(3,) ω, rad/s, and (3,) v, m/s, such that the points x of a link move by ω × x + v in camera
        axes."""
        R, t = self.R_cam_from_body, self.t_body_cam_m
        omega_rad_s, v_m_s = (np.zeros(3), np.zeros(3)) if self.is_carried else self.rates.relative(R, t)
        if link == 0:
            return omega_rad_s, v_m_s
        own_rad_s, own_m_s = self.articulation.motion(link)
        turning_rad_s = R @ own_rad_s
        return omega_rad_s + turning_rad_s, v_m_s + R @ own_m_s - np.cross(turning_rad_s, t)

    def seen_from(self, mount: Mount) -> Self:
        """The state in the axes of a sensor beside the camera."""
        R_sensor_from_cam, rates = mount.R_camera_from_sensor.T, self.rates
        swing_m_s = np.cross(rates.omega_camera_rad_s, mount.position_m)
        return replace(
            self,
            R_cam_from_body=R_sensor_from_cam @ self.R_cam_from_body,
            t_body_cam_m=R_sensor_from_cam @ (self.t_body_cam_m - mount.position_m),
            rates=Rates(
                R_sensor_from_cam @ (rates.v_body_cam_m_s - swing_m_s),
                rates.omega_body_rad_s,
                R_sensor_from_cam @ rates.omega_camera_rad_s,
            ),
        )

    @property
    def range_m(self) -> float:
        """Distance between the camera and the body's origin, m."""
        return float(np.linalg.norm(self.t_body_cam_m))


class LinkPoses(NamedTuple):
    """Where every link of a scene is in camera axes: x_cam = R_cam_from_link x_link + t_link_cam_m.

    The links are numbered through the bodies, the target first: of each the body's own link, then one
    for each of its joints.

    Attributes:
        R_cam_from_link: (L, 3, 3).
        t_link_cam_m: (L, 3).
    """

    R_cam_from_link: FloatArray
    t_link_cam_m: FloatArray


class WorldPoses(NamedTuple):
    """Where the camera and every link are in axes that suit renderers of single precision.

    The axes are parallel to the target's body axes. Their origin is the target's, so that what is small
    on the target is not lost at a large range; beside other bodies it is the camera's, so that nothing
    is lost in any direction of view. The target's own link stays where it is, to the bit, if there are
    no other bodies.

    Attributes:
        R_cam_from_world: (3, 3): x_cam = R_cam_from_world x_world + t_world_cam_m.
        t_world_cam_m: (3,).
        R_world_from_link: (L, 3, 3): x_world = R_world_from_link x_link + t_link_world_m; the links are
            numbered as in :class:`LinkPoses`.
        t_link_world_m: (L, 3).
    """

    R_cam_from_world: FloatArray
    t_world_cam_m: FloatArray
    R_world_from_link: FloatArray
    t_link_world_m: FloatArray


@dataclass(frozen=True)
class CraftState(BodyState):
    """The target, the bodies beside it and their sunlight at one instant, in camera axes.

    No position is of planetary size, so single precision suffices.

    Attributes:
        sun_direction_cam: (3,) unit vector from the spacecraft to the Sun, camera axes.
        sun_irradiance_rgb_w_m2: (3,) irradiance at the spacecraft on a plate that faces the Sun, in the
            red, green and blue band, already reduced by an eclipse.
        sun_angular_radius_rad: angular radius of the Sun's disc, seen from the spacecraft.
        others: the bodies beside the target, in the order of ``Scene.others``. The Sun
            lights them as it does the target.
    """

    sun_direction_cam: FloatArray = field(kw_only=True)
    sun_irradiance_rgb_w_m2: FloatArray = field(kw_only=True)
    sun_angular_radius_rad: float = field(kw_only=True)
    others: tuple[BodyState, ...] = field(default=(), kw_only=True)

    @classmethod
    def unlit(
        cls,
        R_cam_from_body: FloatArray,
        t_body_cam_m: FloatArray,
        *,
        rates: Rates = AT_REST,
        articulation: Articulation = RIGID,
        is_carried: bool = False,
    ) -> Self:
        """A state without sunlight, for what depends on geometry alone.

        The arguments are as in :class:`BodyState`.
        """
        return cls(
            R_cam_from_body,
            t_body_cam_m,
            rates=rates,
            articulation=articulation,
            is_carried=is_carried,
            sun_direction_cam=np.array([0.0, 0.0, -1.0]),
            sun_irradiance_rgb_w_m2=np.zeros(3),
            sun_angular_radius_rad=0.0,
        )

    def after(self, after_s: float) -> Self:
        """The state ``after_s`` later (or earlier, if negative), by its rates."""
        if after_s == 0:
            return self
        R_then_from_now = matrix_from_rotation_vector(-after_s * self.rates.omega_camera_rad_s)
        return replace(
            super().after(after_s),
            sun_direction_cam=R_then_from_now @ self.sun_direction_cam,
            others=tuple(body.after(after_s) for body in self.others),
        )

    def seen_from(self, mount: Mount) -> Self:
        """The state in the axes of a sensor beside the camera."""
        return replace(
            super().seen_from(mount),
            sun_direction_cam=mount.R_camera_from_sensor.T @ self.sun_direction_cam,
            others=tuple(body.seen_from(mount) for body in self.others),
        )

    @property
    def bodies(self) -> tuple[BodyState, ...]:
        """The target and the bodies beside it, numbered as in :attr:`posse_core.Scene.bodies`."""
        return (self, *self.others)

    def link_poses(self) -> LinkPoses:
        """Where every link of the scene is."""
        R_cam_from_link, t_link_cam_m = [], []
        for body in self.bodies:
            R, t_m = body.articulation.poses()
            # A body's own link has its pose to the bit.
            R_cam_from_link += [body.R_cam_from_body[None], body.R_cam_from_body @ R[1:]]
            t_link_cam_m += [
                body.t_body_cam_m[None],
                t_m[1:] @ body.R_cam_from_body.T + body.t_body_cam_m,
            ]
        return LinkPoses(np.concatenate(R_cam_from_link), np.concatenate(t_link_cam_m))

    def world_poses(self) -> WorldPoses:
        """Where the camera and every link are in axes that suit single precision."""
        R_world_from_cam = self.R_cam_from_body.T
        t_world_cam_m = np.zeros(3) if self.others else self.t_body_cam_m
        R_own, t_own_m = self.articulation.poses()
        R_cam_from_link, t_link_cam_m = self.link_poses()
        links = self.articulation.links
        return WorldPoses(
            self.R_cam_from_body,
            t_world_cam_m,
            np.concatenate([R_own, R_world_from_cam @ R_cam_from_link[links:]]),
            (t_link_cam_m - t_world_cam_m) @ self.R_cam_from_body if self.others else t_own_m,
        )

    def about(self, number: int) -> CraftState:
        """The same state with body ``number`` in the target's place; see
        :meth:`posse_core.Scene.about`."""
        if number == 0:
            return self
        body, bodies = self.bodies[number], self.bodies
        return replace(
            self,
            R_cam_from_body=body.R_cam_from_body,
            t_body_cam_m=body.t_body_cam_m,
            rates=body.rates,
            articulation=body.articulation,
            is_carried=body.is_carried,
            finishes=body.finishes,
            others=tuple(_body_of(bodies[k]) for k in range(len(bodies)) if k != number),
        )

    @property
    def sun_direction_body(self) -> FloatArray:
        """(3,) unit vector from the spacecraft to the Sun, body axes."""
        return np.asarray(self.R_cam_from_body.T @ self.sun_direction_cam)


def _body_of(state: BodyState) -> BodyState:
    return BodyState(
        state.R_cam_from_body,
        state.t_body_cam_m,
        state.rates,
        state.articulation,
        state.is_carried,
        state.finishes,
    )
