"""A look: what an annotator or a sensor may ask of one instant of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from posse_core._geometry.raycast import RayCaster
from posse_core._model.camera import Camera
from posse_core._model.labels import View
from posse_core._model.light import Light, LightRequest
from posse_core._model.mount import Mount
from posse_core._model.ray_hits import RayHits
from posse_core._model.scene import FrameState, Onward, Scene
from posse_core._model.sky_view import SkyView
from posse_core._randomness import random_generator

_EARTHSHINE_STEP_RAD = np.radians(1.0)
"""Turn of the camera's view of the Earth during which the Earth-shine of one reading stays the same."""
_ORBIT_RAD_S = 0.0012
"""Largest rate at which the Earth turns in the view of a camera that does not turn itself: in the lowest
orbits."""


@dataclass(frozen=True)
class Standpoint:
    """Who looks, and when. Looks are made of it by the core.

    Attributes:
        state: the frame's state, in the axes of the chaser's camera.
        mount: of who looks.
        seed: of the run.
        who: whose look it is; begins the purpose of every random draw of the look.
        number: of the reading within the frame.
        reading_s: seconds from the frame's instant to that of the look's reading.
        duration_s: seconds from there to the next reading.
        after_s: seconds from the reading's instant to the look's.
        by_rates: whether the motion after the reading's instant is that of its rates.
        about: number of the body that is looked at in the target's place.
    """

    state: FrameState
    mount: Mount
    seed: int
    who: str
    number: int = 0
    reading_s: float = 0.0
    duration_s: float = 0.0
    after_s: float = 0.0
    by_rates: bool = False
    about: int = 0


class Look:
    """One instant as an annotator or a sensor looks at it; each answer is computed when it is asked for.

    All that it gives is in the axes of who looks: the chaser's camera for an annotator, the sensor's own
    axes for a sensor. It knows geometry alone, so what is made of it is equal for every renderer.
    """

    def __init__(
        self, standpoint: Standpoint, scene: Scene, geometry: Callable[[Camera], RayCaster]
    ) -> None:
        """Made by the core.

        Args:
            standpoint: who looks, and when.
            scene: the bodies, and the camera that :meth:`view` is through if none is named.
            geometry: the ray caster of a camera.
        """
        self._standpoint = standpoint
        self._geometry = geometry
        self._whole = scene, _state_of(standpoint)
        self._views: dict[Camera, tuple[View, ...]] = {}
        self.scene = scene.about(standpoint.about)
        self.state = self._whole[1].about(standpoint.about)

    @property
    def index(self) -> int:
        """Index of the frame."""
        return self.state.index

    @property
    def number(self) -> int:
        """Number of the sensor's reading within the frame, from 0; 0 for an annotator."""
        return self._standpoint.number

    @property
    def duration_s(self) -> float:
        """Seconds until the sensor's next reading, or an annotator's next frame; 0 where there is none
        or it is not known."""
        return self._standpoint.duration_s - self._standpoint.after_s

    def view(self, camera: Camera | None = None) -> View:
        """The bodies as the rays of a camera at the origin hit them, one through each pixel's centre.

        Args:
            camera: any camera; None is the chaser's for an annotator, and a sensor's own.
        """
        camera = self.scene.camera if camera is None else camera
        if camera not in self._views:
            self._views[camera] = self._geometry(camera).views(self._whole[1].craft)
        return self._views[camera][self._standpoint.about]

    def about(self, number: int) -> Look:
        """The same look with body ``number`` of the scene in the target's place, whose labels it then
        gives, and the target among the others. It gives geometry alone.

        Args:
            number: as in :attr:`posse_core.Scene.bodies` of a look that is about the target.
        """
        other = Look(replace(self._standpoint, about=number), self._whole[0], self._geometry)
        other._views = self._views
        return other

    def rays(
        self, directions: ArrayLike, *, origin_m: ArrayLike = (0.0, 0.0, 0.0), after_s: ArrayLike = 0.0
    ) -> RayHits:
        """Where rays of one's own first hit a body, each at its own instant.

        Args:
            directions: (N, 3) of any length, in the axes of who looks at the ray's instant.
            origin_m: (3,) or (N, 3), likewise.
            after_s: (N,) or one for all: seconds after the look's instant. Motion until then is that of
                the rates, as while a shutter is open.
        """
        caster = self._geometry(self.scene.camera)
        hits = caster.rays(
            self._whole[1].craft,
            np.asarray(directions, dtype=np.float64),
            origin_m,
            after_s,
        )
        return caster.renumbered(hits, self._standpoint.about)

    def speed_px_s(self, camera: Camera | None = None) -> float:
        """Largest speed that a point of a body may have in the image of a camera at the origin,
        pixels per second; 0 where no body is in view.

        Args:
            camera: as in :meth:`view`.
        """
        caster = self._geometry(self.scene.camera if camera is None else camera)
        craft = self._whole[1].craft
        return 0.0 if caster.box(craft).is_empty else caster.speed_px_s(craft)

    def at(self, after_s: float, *, by_rates: bool = False) -> Self:
        """The same look at a neighbouring instant.

        Args:
            after_s: seconds after this one's instant; before it, if negative.
            by_rates: go on by the rates of the reading's instant, which takes 0.2 ms, and not by the
                scenario's propagator and attitude laws, which takes 4 ms. A state that a caller gave to
                the simulator always goes on by its rates.
        """
        return self._made(
            replace(
                self._standpoint,
                after_s=self._standpoint.after_s + after_s,
                by_rates=by_rates or self._standpoint.by_rates,
            )
        )

    @property
    def from_camera(self) -> Look:
        """The same instant from the place and in the axes of the chaser's camera.

        It gives geometry alone. Its :meth:`view` is still through the pixels of the sensor's own camera
        if none is named.
        """
        return Look(replace(self._standpoint, mount=Mount()), self._whole[0], self._geometry)

    @property
    def follows_scenario(self) -> bool:
        """Whether :meth:`at` goes by the scenario's propagator and attitude laws, as far as one likes; a
        state that a caller gave to the simulator goes on by its rates, which holds for seconds."""
        return self._standpoint.state.onward is not None

    @property
    def next_frame(self) -> Self | None:
        """The look at the instant of the sequence's next frame; None where there is none or it is not
        known."""
        onward = self._standpoint.state.onward
        state = None if onward is None else onward.next_frame()
        if state is None:
            return None
        stand = self._standpoint
        return self._made(Standpoint(state, stand.mount, stand.seed, stand.who, about=stand.about))

    def generator(self, purpose: str) -> np.random.Generator:
        """The generator of this frame's random draws for a purpose; the same whenever it is asked for.

        Who looks, the sensor's name and the number of its reading are part of it, so draws of two
        sensors, readings or frames are independent.
        """
        stand = self._standpoint
        return random_generator(stand.seed, self.state.index, f"{_purpose(stand)}: {purpose}")

    def _made(self, standpoint: Standpoint) -> Self:
        return type(self)(standpoint, self._whole[0], self._geometry)


class SensorLook(Look):
    """A look that also sees light: what a sensor senses by."""

    def __init__(
        self,
        standpoint: Standpoint,
        scene: Scene,
        geometry: Callable[[Camera], RayCaster],
        gather: Callable[[LightRequest], Light],
        earthshine: dict[tuple[float, bool], FrameState] | None = None,
        image_light: Light | None = None,
    ) -> None:
        """Made by the core.

        Args:
            standpoint, scene, geometry: as in :class:`Look`.
            gather: collects the light of a camera.
            earthshine: states of this reading whose Earth-shine was asked for, by seconds after its
                instant and whether its rates led there; None for none.
            image_light: the light that the frame's image was made of; None where the look is not that
                of the chaser's camera at the frame's instant.
        """
        super().__init__(standpoint, scene, geometry)
        self.image_light = image_light
        self._gather = gather
        self._earthshine = {} if earthshine is None else earthshine

    def light(
        self,
        camera: Camera | None = None,
        *,
        exposure_s: float = 0.0,
        instants: int = 1,
        sky: SkyView | None = None,
    ) -> Light:
        """The light that reaches the pixels of a camera at the origin.

        The random draws of a renderer that samples are those of the reading: at another instant of one
        reading (:meth:`at`) they are the same, so that they do not flicker. So is the Earth-shine on the
        spacecraft, until the camera or the Earth in its view has turned by half a degree.

        Args:
            camera: any camera; None is the sensor's own. The first use of a camera opens a renderer.
            exposure_s: over which the light is averaged.
            instants: the largest number of instants that are averaged; fewer where little moves.
            sky: the sky, where it is known already; None to compute it.
        """
        return self._gather(
            LightRequest(
                self.state,
                self.scene.camera if camera is None else camera,
                exposure_s,
                instants,
                purpose=f"{_purpose(self._standpoint)}: renderer",
                earthshine=self._state_of_earthshine(),
                sky=sky,
            )
        )

    def _state_of_earthshine(self) -> FrameState:
        """The nearest in time of the states from one to the next of which the camera's view of the Earth
        turns by a degree."""
        stand = self._standpoint
        turn_rad_s = float(np.linalg.norm(self._earthshine_at(0.0).craft.rates.omega_camera_rad_s))
        step_s = _EARTHSHINE_STEP_RAD / (turn_rad_s + _ORBIT_RAD_S)
        return self._earthshine_at(round(stand.after_s / step_s) * step_s)

    def _earthshine_at(self, after_s: float) -> FrameState:
        by_rates = self._standpoint.by_rates and after_s != 0
        stand = replace(self._standpoint, after_s=after_s, by_rates=by_rates)
        key = after_s, by_rates
        if key not in self._earthshine:
            self._earthshine[key] = _state_of(stand)
        return self._earthshine[key]

    def _made(self, standpoint: Standpoint) -> Self:
        same_reading = standpoint.state is self._standpoint.state
        return type(self)(
            standpoint,
            self._whole[0],
            self._geometry,
            self._gather,
            self._earthshine if same_reading else None,
        )


def _purpose(stand: Standpoint) -> str:
    return f"{stand.who} {stand.number}"


def _state_of(stand: Standpoint) -> FrameState:
    """The state at a standpoint's instant, in its own axes."""
    onward = stand.state.onward
    if stand.by_rates:
        reading = _moved(stand.state, stand.reading_s, onward)
        return reading.seen_from(stand.mount).after(stand.after_s)
    return _moved(stand.state, stand.reading_s + stand.after_s, onward).seen_from(stand.mount)


def _moved(state: FrameState, after_s: float, onward: Onward | None) -> FrameState:
    if after_s == 0:
        return state
    return state.after(after_s) if onward is None else onward.at(after_s)
