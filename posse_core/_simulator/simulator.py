"""The simulator: a scenario held in memory, asked for states and for frames."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import TracebackType
from typing import Self

from numpy.typing import ArrayLike

from posse_core._dataset.sensors import SensorInfo
from posse_core._environment.time import Epoch
from posse_core._imaging.image_sensor import ImageSensor
from posse_core._model.camera import Camera
from posse_core._model.light import LightRequest
from posse_core._model.scene import FrameState
from posse_core._model.spacecraft import Spacecraft
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.registry import Registry
from posse_core._scenario.model import Scenario
from posse_core._simulator.annotation import Annotation
from posse_core._simulator.frame import Frame
from posse_core._simulator.optics import Optics
from posse_core._simulator.reopening import chosen_renderer
from posse_core._simulator.scene import scene_of
from posse_core._simulator.sensing import Sensing, annotated_look, open_sensors
from posse_core._simulator.states import States
from posse_core._threads import one_thread_for_algebra
from posse_core._trajectory.joints import GivenJoints
from posse_core._trajectory.problem import orbit_epoch


class Simulator:
    """A scenario's spacecraft, camera, sky and renderer, ready to take frames at any state.

    Open one by :func:`posse_core.open`; use it as a context manager, or call :meth:`close` at the end.
    Everything happens in this process and in memory. A frame depends on its state, on the frame's index
    and on the scenario with its seed, and on nothing that was asked for before.

    Attributes:
        scenario: the checked scenario.
        scene: the spacecraft and the camera.
    """

    def __init__(
        self,
        scenario: Scenario,
        registry: Registry,
        trajectory: Trajectory | None = None,
    ) -> None:
        """Build everything and open the renderer.

        Args:
            scenario: as by ``load_scenario``.
            registry: the components that are installed.
            trajectory: the scenario's, where it has been computed already.

        Raises:
            InputError: a file that the scenario names cannot be used.
            ComponentError: this machine lacks what the renderer needs.
        """
        self.scenario = scenario
        camera = scenario.camera.camera()
        self.scene = scene_of(scenario, registry)
        self._states = States(scenario, self.scene, registry, trajectory)
        epoch = Epoch.from_iso(orbit_epoch(scenario.orbit).iso())  # as a trajectory's file has it
        self._annotation = Annotation(scenario.annotators, registry, epoch)
        self._image_sensor = ImageSensor(scenario.sensor, camera)
        self._sensors = open_sensors(scenario, registry, self.scene, self._annotation.labels)
        make_renderer = partial(chosen_renderer, registry, scenario.renderer)
        self._optics = Optics(self.scene, scenario.sky, scenario.seed, make_renderer)
        self._optics.open(camera)
        self._sensing = Sensing(self._sensors, self._optics, scenario.seed)

    @property
    def camera(self) -> Camera:
        """The scenario's camera."""
        return self.scene.camera

    @property
    def spacecraft(self) -> Spacecraft:
        """The scenario's spacecraft."""
        return self.scene.spacecraft

    @property
    def sensors(self) -> Mapping[str, SensorInfo]:
        """The sensors beside the camera, by name."""
        return {sensor.name: sensor.info for sensor in self._sensors}

    @property
    def trajectory(self) -> Trajectory:
        """The motion over the scenario's frames.

        Raises:
            InputError: the orbit cannot be propagated by the scenario's model.
        """
        return self._states.trajectory

    def state(
        self,
        index: int = 0,
        *,
        t_s: float | None = None,
        r_rtn_m: ArrayLike | None = None,
        v_rtn_m_s: ArrayLike | None = None,
        q_eci_from_body: ArrayLike | None = None,
        q_eci_from_camera: ArrayLike | None = None,
        omega_body_rad_s: ArrayLike | None = None,
        omega_camera_rad_s: ArrayLike | None = None,
        joints: Mapping[str, float] | None = None,
        joint_rates: Mapping[str, float] | None = None,
    ) -> FrameState:
        """A state to take a frame at. What is not given comes from the scenario.

        ``sim.state(5)`` is the scenario's own frame 5. With ``t_s`` it is the scenario at that time, and
        ``index`` is only the number that the frame gets; random draws depend on it, so give each frame
        of a loop its own.

        Args:
            index: number of the frame, from 0.
            t_s: seconds since the scenario's epoch; None is the time of the scenario's frame ``index``.
            r_rtn_m: (3,) chaser's position relative to the target, in the target's RTN axes.
            v_rtn_m_s: (3,) its derivative in the rotating RTN frame; at rest there if only the position
                is given.
            q_eci_from_body: (4,) attitude of the target, scalar first, GCRF axes from body axes.
            q_eci_from_camera: (4,) attitude of the camera, likewise.
            omega_body_rad_s, omega_camera_rad_s: (3,) angular velocities against GCRF axes, in body and
                in camera axes, beside a given attitude; zero if not given.
            joints: name of a joint that the scenario's key ``joints`` moves → its value, rad or m, in
                place of its law's.
            joint_rates: name of a joint with a given value → its rate, rad/s or m/s; zero if not given.

        Raises:
            InputError: there is no such frame; a velocity without a position, a rate without an
                attitude, or a shape that does not fit; a time that the propagator has no motion for; a
                joint that no law moves, or a value beyond a joint's limits.
        """
        given_joints = GivenJoints(joints or {}, joint_rates or {})
        self._states.joint_laws.check_given(given_joints)
        row = self._states.row(
            index,
            t_s=t_s,
            r_rtn_m=r_rtn_m,
            v_rtn_m_s=v_rtn_m_s,
            q_eci_from_body=q_eci_from_body,
            q_eci_from_camera=q_eci_from_camera,
            omega_body_rad_s=omega_body_rad_s,
            omega_camera_rad_s=omega_camera_rad_s,
        )
        by_scenario = all(given is None for given in (r_rtn_m, q_eci_from_body, q_eci_from_camera))
        own_frame = by_scenario and t_s is None
        if own_frame:
            state = self._states.own(index, given_joints)
        else:
            state = self._states.of_row(row, index, given=given_joints)
        if by_scenario and not joints:
            return self._states.onward(index, state, own_frame=own_frame)
        return state

    def frame(self, state: FrameState) -> Frame:
        """The frame that the camera takes at a state, and the readings of the sensors beside it.

        Where the renderer works in a process of its own and that process dies, the renderer is opened
        again and asked for the same image, three times in all.

        Raises:
            InputError: a sensor would take too many readings until the next frame.
            ComponentError: the renderer, an annotator or a sensor failed.
            WorkerLost: the renderer's process died at every try.
        """
        with one_thread_for_algebra():
            return self._frame(state)

    def _frame(self, state: FrameState) -> Frame:
        seed = self.scenario.seed
        photograph = self._image_sensor.photograph(
            lambda exposure_s, instants: self._optics.light(
                LightRequest(
                    state, self.camera, exposure_s, instants, purpose="renderer", earthshine=state
                )
            ),
            seed,
            state.index,
        )
        look = annotated_look(state, self.scene, self._optics, seed)
        labels = self._annotation.labels(look)
        readings, beside = self._sensing.of(state, photograph.light)
        line = self._annotation.line(look, labels, photograph.exposure_s, beside)
        return Frame(
            state,
            self.camera,
            photograph.image,
            photograph.exposure_s,
            line,
            labels.arrays,
            photograph.light,
            readings,
        )

    def describe_renderer(self) -> Mapping[str, str]:
        """Versions and choices of the renderer, such as ``{"mitsuba": "3.9.1"}``."""
        return self._optics.describe()

    def close(self) -> None:
        """Free the renderer; may be called twice."""
        self._optics.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        camera = self.camera
        return (
            f"<Simulator of {self.spacecraft.name}: {camera.width_px} × {camera.height_px},"
            f" renderer {self.scenario.renderer.name}>"
        )
