"""The input and the output of renderers, and the state of a frame, which the sky also needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from posse_core._arrays import Float32Array, FloatArray, IntArray
from posse_core._constants import EARTH_ROTATION_RATE_RAD_S
from posse_core._frames import matrix_from_rotation_vector
from posse_core._model.bands import SOLAR_BAND_FRACTIONS
from posse_core._model.camera import Camera, PixelBox
from posse_core._model.craft_state import AT_REST, BodyState, CraftState, Rates
from posse_core._model.finish import Finish
from posse_core._model.joints import RIGID, Articulation
from posse_core._model.mount import Mount
from posse_core._model.spacecraft import Material, Part, Spacecraft

_ZERO = np.zeros(3)


@dataclass(frozen=True)
class Body:
    """A body beside the target: another spacecraft, a fragment, or a structure of the chaser's own.

    Attributes:
        name: of this body, unique within the scene; several bodies may be the same spacecraft.
        spacecraft: what it looks like.
    """

    name: str
    spacecraft: Spacecraft


class Piece(NamedTuple):
    """A part of one of a scene's bodies, as a renderer places it.

    Attributes:
        part: its mesh, in the axes of its link.
        material: the part's.
        link: index of the link that moves it, as in :class:`LinkPoses`.
    """

    part: Part
    material: Material
    link: int


@dataclass(frozen=True)
class Scene:
    """What is the same for all frames of a run.

    Attributes:
        spacecraft: the target.
        camera: the camera.
        others: the bodies beside the target.
    """

    spacecraft: Spacecraft
    camera: Camera
    others: tuple[Body, ...] = ()

    @property
    def bodies(self) -> tuple[Spacecraft, ...]:
        """The target and the bodies beside it. Wherever bodies are numbered, the target is 0."""
        return (self.spacecraft, *(body.spacecraft for body in self.others))

    @cached_property
    def links(self) -> tuple[tuple[int, int], ...]:
        """Number of the body, and number of the link within it, of every link, in the order of
        :class:`LinkPoses`."""
        return tuple(
            (body, link)
            for body, spacecraft in enumerate(self.bodies)
            for link in range(len(spacecraft.joints) + 1)
        )

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The parts of all bodies. A part's id in the labels is its index here, which for the target is
        its index in ``spacecraft.parts``."""
        return tuple(
            Piece(
                part,
                spacecraft.materials[part.material],
                self.links.index((body, spacecraft.link_of(part.joint))),
            )
            for body, spacecraft in enumerate(self.bodies)
            for part in spacecraft.parts
        )

    @cached_property
    def link_of_part(self) -> IntArray:
        """(P,) index of the link that moves each of :attr:`pieces`."""
        return np.array([piece.link for piece in self.pieces], dtype=np.int64)

    @cached_property
    def link_radii_m(self) -> FloatArray:
        """(L,) radius of the smallest sphere about the origin of each link's axes that contains every
        vertex of the link, m; 0 for a link without a part."""
        radii_m = np.zeros(len(self.links))
        for piece in self.pieces:
            farthest_m = np.sqrt((piece.part.vertices_body_m**2).sum(axis=1).max())
            radii_m[piece.link] = max(radii_m[piece.link], farthest_m)
        return radii_m

    @cached_property
    def body_of_part(self) -> IntArray:
        """(P,) number of the body that each of :attr:`pieces` belongs to."""
        counts = [len(spacecraft.parts) for spacecraft in self.bodies]
        return np.repeat(np.arange(len(counts)), counts)

    def finishes(self, craft: CraftState) -> tuple[Finish | None, ...]:
        """For each of :attr:`pieces` the factors of its material in a frame; None if none vary."""
        bodies = craft.bodies
        return tuple(
            bodies[body].finishes.get(piece.part.material)
            for piece, body in zip(self.pieces, self.body_of_part, strict=True)
        )

    def materials(self, craft: CraftState) -> tuple[Material, ...]:
        """The material of each of :attr:`pieces` in a frame: the piece's own, with the factors that
        vary."""
        return tuple(
            piece.material if finish is None else finish.on(piece.material)
            for piece, finish in zip(self.pieces, self.finishes(craft), strict=True)
        )

    def about(self, number: int) -> Scene:
        """The same scene with body ``number`` in the target's place, and the target among the others."""
        if number == 0:
            return self
        names = ("", *(body.name for body in self.others))
        rest = [k for k in range(len(names)) if k != number]
        others = tuple(Body(names[k], self.bodies[k]) for k in rest)
        return Scene(self.bodies[number], self.camera, others)


@dataclass(frozen=True)
class Onward:
    """How a state of the scenario's own motion goes on.

    Attributes:
        duration_s: time until the next frame of the sequence; 0 if it is the last one.
        at: seconds after the frame's instant, also before it → the state then, by the scenario's
            propagator and attitude laws, with the random errors of this frame.
        next_frame: the state of the next frame, with random errors of its own; None if there is none.
    """

    duration_s: float
    at: Callable[[float], FrameState]
    next_frame: Callable[[], FrameState | None]


@dataclass(frozen=True)
class FrameState:
    """The state of one frame: the spacecraft relative to the camera, and both relative to the Earth.

    Attributes:
        index: index of the frame, from 0; together with the run's seed it determines all random draws.
        sequence: index of the continuous relative orbit that the frame belongs to.
        t_s: seconds since the scenario's epoch.
        epoch_jd_tt: Julian date of the frame in terrestrial time.
        craft: the spacecraft and its sunlight, in camera axes.
        R_cam_from_eci: (3, 3) rotation from GCRF axes to camera axes.
        R_ecef_from_eci: (3, 3) the Earth's rotation, GCRF → ITRF.
        r_camera_eci_m, r_target_eci_m, r_sun_eci_m, r_moon_eci_m: (3,) geocentric positions, GCRF axes.
        v_camera_eci_m_s: (3,) geocentric velocity of the camera, GCRF axes.
        solar_flux_w_m2: total irradiance at the target by the whole Sun, at its true distance.
        sun_fraction_target: share of the Sun's disc that the Earth leaves free, seen from the target.
        sun_fraction_camera: the same, seen from the camera.
        onward: how the scenario goes on from here; None for a state that a caller gave.
    """

    index: int
    sequence: int
    t_s: float
    epoch_jd_tt: float
    craft: CraftState
    R_cam_from_eci: FloatArray
    R_ecef_from_eci: FloatArray
    r_camera_eci_m: FloatArray
    v_camera_eci_m_s: FloatArray
    r_target_eci_m: FloatArray
    r_sun_eci_m: FloatArray
    r_moon_eci_m: FloatArray
    solar_flux_w_m2: float
    sun_fraction_target: float
    sun_fraction_camera: float
    onward: Onward | None = field(default=None, compare=False, repr=False)

    @classmethod
    def of(
        cls,
        *,
        index: int,
        sequence: int = 0,
        t_s: float,
        epoch_jd_tt: float,
        R_cam_from_body: FloatArray,
        t_body_cam_m: FloatArray,
        R_cam_from_eci: FloatArray,
        R_ecef_from_eci: FloatArray,
        r_camera_eci_m: FloatArray,
        v_camera_eci_m_s: FloatArray = _ZERO,
        r_target_eci_m: FloatArray,
        r_sun_eci_m: FloatArray,
        r_moon_eci_m: FloatArray,
        solar_flux_w_m2: float,
        sun_fraction_target: float,
        sun_fraction_camera: float,
        sun_angular_radius_rad: float,
        rates: Rates = AT_REST,
        articulation: Articulation = RIGID,
        others: tuple[BodyState, ...] = (),
    ) -> FrameState:
        """Make a state, computing the sunlight in camera axes from the geocentric positions.

        The arguments are as in :class:`FrameState` and :class:`CraftState`.
        """
        to_sun_cam_m = R_cam_from_eci @ (r_sun_eci_m - r_target_eci_m)
        craft = CraftState(
            R_cam_from_body=R_cam_from_body,
            t_body_cam_m=t_body_cam_m,
            sun_direction_cam=np.asarray(to_sun_cam_m / np.linalg.norm(to_sun_cam_m)),
            sun_irradiance_rgb_w_m2=solar_flux_w_m2 * sun_fraction_target * SOLAR_BAND_FRACTIONS,
            sun_angular_radius_rad=sun_angular_radius_rad,
            rates=rates,
            articulation=articulation,
            others=others,
        )
        return cls(
            index=index,
            sequence=sequence,
            t_s=t_s,
            epoch_jd_tt=epoch_jd_tt,
            craft=craft,
            R_cam_from_eci=R_cam_from_eci,
            R_ecef_from_eci=R_ecef_from_eci,
            r_camera_eci_m=r_camera_eci_m,
            v_camera_eci_m_s=v_camera_eci_m_s,
            r_target_eci_m=r_target_eci_m,
            r_sun_eci_m=r_sun_eci_m,
            r_moon_eci_m=r_moon_eci_m,
            solar_flux_w_m2=solar_flux_w_m2,
            sun_fraction_target=sun_fraction_target,
            sun_fraction_camera=sun_fraction_camera,
        )

    def after(self, after_s: float) -> FrameState:
        """The frame ``after_s`` later (or earlier, if negative), by its rates."""
        if after_s == 0:
            return self
        omega_camera_rad_s = self.craft.rates.omega_camera_rad_s
        R_then_from_now = matrix_from_rotation_vector(-after_s * omega_camera_rad_s)
        earth_turn = matrix_from_rotation_vector(np.array([0, 0, -after_s * EARTH_ROTATION_RATE_RAD_S]))
        moved_m = after_s * self.v_camera_eci_m_s
        return replace(
            self,
            t_s=self.t_s + after_s,
            epoch_jd_tt=self.epoch_jd_tt + after_s / 86400,
            craft=self.craft.after(after_s),
            R_cam_from_eci=R_then_from_now @ self.R_cam_from_eci,
            R_ecef_from_eci=earth_turn @ self.R_ecef_from_eci,
            r_camera_eci_m=self.r_camera_eci_m + moved_m,
            r_target_eci_m=self.r_target_eci_m + moved_m,  # relative motion is negligible here
            onward=None,
        )

    def about(self, number: int) -> FrameState:
        """The same state with body ``number`` in the target's place; see :meth:`Scene.about`."""
        return replace(self, craft=self.craft.about(number)) if number else self

    def seen_from(self, mount: Mount) -> FrameState:
        """The state as a sensor beside the camera sees it: its axes stand in place of the camera's.

        It has no :attr:`onward`.
        """
        R_eci_from_cam = self.R_cam_from_eci.T
        swing_m_s = np.cross(self.craft.rates.omega_camera_rad_s, mount.position_m)
        return replace(
            self,
            craft=self.craft.seen_from(mount),
            R_cam_from_eci=mount.R_camera_from_sensor.T @ self.R_cam_from_eci,
            r_camera_eci_m=self.r_camera_eci_m + R_eci_from_cam @ mount.position_m,
            v_camera_eci_m_s=self.v_camera_eci_m_s + R_eci_from_cam @ swing_m_s,
            onward=None,
        )


@dataclass(frozen=True)
class EnvironmentMap:
    """Light from everywhere but the Sun and the spacecraft, as an equirectangular map in camera axes.

    Attributes:
        radiance_rgb: (h, w, 3) float32 radiance, W m⁻² sr⁻¹. Row i, column j has the direction
            (sin θ sin φ, −cos θ, sin θ cos φ) in camera axes, with θ = π (i + ½)/h and
            φ = 2π (j + ½)/w − π. The centre of the map is forward, and the top row is up (−y).
    """

    radiance_rgb: Float32Array

    @staticmethod
    def directions_cam(height: int) -> FloatArray:
        """(height, 2·height, 3) unit vectors, camera axes: the directions of the pixels of a map of so
        many rows."""
        theta = np.pi * (np.arange(height)[:, None] + 0.5) / height
        phi = np.pi * (np.arange(2 * height) + 0.5) / height - np.pi
        up = np.broadcast_to(-np.cos(theta), (height, 2 * height))
        return np.stack([np.sin(theta) * np.sin(phi), up, np.sin(theta) * np.cos(phi)], axis=-1)


@dataclass(frozen=True)
class RenderRequest:
    """A request to render one image of the spacecraft.

    Attributes:
        craft: the spacecraft and its sunlight, in camera axes.
        box: the part of the image to render; never empty, never outside the image.
        environment: light from the sky; None if the sky is black.
        seed: seed of all random draws of the renderer in this frame.
        index: index of the frame, for messages.
    """

    craft: CraftState
    box: PixelBox
    environment: EnvironmentMap | None
    seed: int
    index: int = 0


@dataclass(frozen=True)
class Radiance:
    """Light from the spacecraft alone, in the requested box.

    Attributes:
        box: the same box as in the request.
        radiance_rgb: (h, w, 3) float32 W m⁻² sr⁻¹ in the red, green and blue band, averaged over the
            pixel; the part of the pixel that the spacecraft does not cover counts as black.
        coverage: (h, w) float32, share of the pixel that the spacecraft covers, 0 … 1.
        depth_m: (h, w) float32 planar z at the pixel's centre, NaN off the spacecraft; None if the
            renderer does not provide it. Only cross-checks use it.
    """

    box: PixelBox
    radiance_rgb: Float32Array
    coverage: Float32Array
    depth_m: Float32Array | None = None
