"""The joints of a body at given instants: by the scenario's laws, or as a caller gives them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from posse_core._arrays import FloatArray, IntArray, array_fault
from posse_core._environment.time import Epoch
from posse_core._errors import ComponentError, InputError
from posse_core._frames import matrix_from_quaternion, matrix_from_rotation_vector, rotated, unit
from posse_core._interfaces.joint_law import JointLaw, JointSurroundings
from posse_core._model.joints import RIGID, Articulation, Joint
from posse_core._model.spacecraft import Spacecraft
from posse_core._model.trajectory import Trajectory
from posse_core._plugins.component import failures_named
from posse_core._plugins.options import nearest
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import create
from posse_core._scenario.joints import JointLawChoice

RATE_STEP_S = 1e-3
"""Half the step of the differences that give rates; they are exact for a steady rate."""
_BEYOND = 1e-9
"""How far a value may be beyond a limit by rounding, rad or m."""


def with_laws(
    spacecraft: Spacecraft, choices: Mapping[str, JointLawChoice], where: str = "joints"
) -> Spacecraft:
    """The spacecraft with the joints that laws move; the others are welded at zero.

    Args:
        spacecraft: with all of its joints.
        choices: name of a joint, or a pattern of names → its law.
        where: the key of the choices, for messages.

    Raises:
        InputError: There is no such joint, or it does not move.
    """
    return spacecraft.welded(_keys_of_joints(spacecraft, choices, where))


def _keys_of_joints(spacecraft: Spacecraft, keys: Iterable[str], where: str) -> dict[str, str]:
    """Name of each joint that moves → the key that moves it: its name, or a pattern such as ``hinge_*``
    for all joints that have no key of their own and are not fixed."""
    joints = {joint.name: joint for joint in spacecraft.joints}
    found: dict[str, str] = {}
    for key in sorted(keys, key=lambda key: key not in joints):
        free = [name for name in joints if name not in found and joints[name].kind != "fixed"]
        matching = [key] if key in joints else [name for name in free if fnmatchcase(name, key)]
        if not matching:
            there = ", ".join(joints) or "none"
            raise InputError(
                f"{where}.{key}: {spacecraft.name} has no such joint{nearest(key, joints)}"
                f" (its joints: {there})"
            )
        if joints[matching[0]].kind == "fixed":
            raise InputError(
                f"{where}.{key}: the joint of {spacecraft.name} is fixed, so no law can move it; leave"
                " the key out"
            )
        found |= dict.fromkeys(matching, key)
    return found


@dataclass(frozen=True)
class BodyMotion:
    """What the joints of a body may depend on, at F instants.

    Attributes:
        t_s: (F,) seconds after the epoch.
        indices: (F,) index of the frame, 0 or more, on which random draws depend.
        R_eci_from_body: (F, 3, 3) attitude of the body, GCRF axes from body axes.
        omega_body_rad_s: (F, 3) its angular velocity relative to GCRF axes, body axes.
        sun_direction_eci: (F, 3) unit vector from the body to the Sun, GCRF axes.
    """

    t_s: FloatArray
    indices: IntArray
    R_eci_from_body: FloatArray
    omega_body_rad_s: FloatArray
    sun_direction_eci: FloatArray

    @classmethod
    def of_target(cls, trajectory: Trajectory, indices: IntArray) -> BodyMotion:
        """That of a trajectory's target, with the index of each frame."""
        return cls(
            trajectory.t_s,
            indices,
            matrix_from_quaternion(trajectory.q_eci_from_body),
            trajectory.omega_body_rad_s,
            unit(trajectory.r_sun_eci_m - trajectory.r_target_eci_m),
        )

    def at(self, after_s: FloatArray) -> BodyMotion:
        """The motion moments after its instants: (N,) seconds → N · F instants, all F for each moment.

        The body turns by its angular velocity, and the Sun stands still.
        """
        count, frames = len(after_s), len(self.t_s)
        later_s = np.repeat(after_s, frames)
        turn = matrix_from_rotation_vector(later_s[:, None] * np.tile(self.omega_body_rad_s, (count, 1)))
        return BodyMotion(
            np.tile(self.t_s, count) + later_s,
            np.tile(self.indices, count),
            np.asarray(np.tile(self.R_eci_from_body, (count, 1, 1)) @ turn),
            np.tile(self.omega_body_rad_s, (count, 1)),
            np.tile(self.sun_direction_eci, (count, 1)),
        )


@dataclass(frozen=True)
class GivenJoints:
    """Joints that a caller sets in place of their laws.

    Attributes:
        values: name of a joint → its value, rad or m.
        rates: name of a joint that has a value → its rate, rad/s or m/s; at rest if it has none.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)


class _Values(NamedTuple):
    """Values (F, J) of joints, rad or m, and what each law that gave some got."""

    values: FloatArray
    around: Mapping[str, JointSurroundings]


BY_LAW = GivenJoints()
"""Every joint moves by its law."""


class JointLaws:
    """The laws that move the joints of one body."""

    def __init__(
        self,
        spacecraft: Spacecraft,
        keys: Mapping[str, str],
        laws: Mapping[str, JointLaw],
        epoch: Epoch,
        seed: int,
        where: str,
    ) -> None:
        """See :meth:`of`, which makes them.

        Args:
            spacecraft: with the joints that the laws move and no others.
            keys: name of each joint → the key that chooses its law.
            laws: name of each joint → its law, which checks its values.
            epoch: the instant of t_s = 0.
            seed: of the run.
            where: the key of the scenario that chooses the laws; it sets the body's random draws apart.
        """
        self._spacecraft, self._keys, self._laws = spacecraft, keys, laws
        self._joints = spacecraft.joints
        self._epoch, self._seed, self._where = epoch, seed, where

    @classmethod
    def of(
        cls,
        spacecraft: Spacecraft,
        choices: Mapping[str, JointLawChoice],
        registry: Registry,
        *,
        epoch: Epoch,
        seed: int,
        where: str = "joints",
    ) -> JointLaws:
        """Make the laws that a scenario chooses for a body.

        Args:
            spacecraft: with the joints that the laws move and no others; see :func:`with_laws`.
            choices: name of a joint → its law.
            registry: the components that are installed.
            epoch: the instant of t_s = 0.
            seed: of the run.
            where: the key of the choices; each body has one of its own.

        Raises:
            InputError: There is no such law, or an option is wrong.
            ComponentError: A law cannot be made.
        """
        laws: dict[str, JointLaw] = {}
        keys = _keys_of_joints(spacecraft, choices, where)
        for joint in spacecraft.joints:
            choice = choices[keys[joint.name]]
            try:
                law: JointLaw = create(registry, "joint-law", choice)
            except InputError as error:
                raise InputError(f"{where}.{joint.name}: {error}") from None
            laws[joint.name] = CheckedJointLaw(law, choice.name, f"{where}.{joint.name}")
        return cls(spacecraft, keys, laws, epoch, seed, where)

    def articulation(self, motion: BodyMotion, given: GivenJoints = BY_LAW) -> Articulation:
        """The joints at the motion's one instant; see :meth:`values_and_rates`."""
        if not self._joints:
            return RIGID
        (values,), (rates,) = self.values_and_rates(motion, given)
        return Articulation(self._joints, values, rates)

    def values_and_rates(
        self, motion: BodyMotion, given: GivenJoints = BY_LAW
    ) -> tuple[FloatArray, FloatArray]:
        """(F, J) values of the joints, rad or m, and (F, J) rates, rad/s or m/s, at F instants.

        Each row depends on its own row of the motion alone.

        Args:
            motion: of the body.
            given: joints that are set in place of their laws.

        Raises:
            InputError: A value is beyond the limits of its joint, or a law cannot move its joint.
            ComponentError: A law failed, or did not return a number for each frame.
        """
        after_s = np.array([-RATE_STEP_S, 0.0, RATE_STEP_S])
        moved = self._values(motion.at(after_s), given, np.repeat(after_s, len(motion.t_s)))
        before, now, after = np.split(moved.values, 3)
        change = after - before
        turning = np.array([joint.kind == "revolute" for joint in self._joints], dtype=bool)
        # A law may go on by whole turns less or more at any time.
        turns = np.where(turning, np.round(change / (2 * np.pi)), 0.0)
        rates = (change - 2 * np.pi * turns) / (2 * RATE_STEP_S)
        for number, joint in enumerate(self._joints):
            self._check_limits(joint, now[:, number], motion.indices)
            if joint.name in given.values:
                rates[:, number] = given.rates.get(joint.name, 0.0)
                continue
            own = self._laws[joint.name].rates(moved.around[joint.name])
            if own is not None:
                rates[:, number] = np.split(own, 3)[1]
        return now, rates

    def check_given(self, given: GivenJoints) -> None:
        """Check what a caller gives.

        Raises:
            InputError: A joint has no law, a rate has no value, or a number is not finite.
        """
        for key, numbers in (("joints", given.values), ("joint_rates", given.rates)):
            for name, number in numbers.items():
                if name not in self._laws:
                    raise InputError(
                        f"state: {key} has {name!r}{nearest(name, self._laws)}, and the joints that the"
                        f" scenario's key {self._where} moves are: {', '.join(self._laws) or 'none'}"
                    )
                if not _is_number(number):
                    raise InputError(f"state: {key}[{name!r}] is {number!r}; a finite number is needed")
        for name in given.rates:
            if name not in given.values:
                raise InputError(f"state: joint_rates has {name!r}, and joints has not; give both")

    def _values(self, motion: BodyMotion, given: GivenJoints, after_s: FloatArray) -> _Values:
        """The values of all joints; the motion is (F,) seconds after the instants of what is given."""
        sun_body = np.einsum("fji,fj->fi", motion.R_eci_from_body, motion.sun_direction_eci)
        # The Sun in the axes of each link that carries a joint; None is the body's own.
        sun_links: dict[str | None, FloatArray] = {None: sun_body}
        carriers = {joint.parent for joint in self._joints}
        values = np.empty((len(motion.t_s), len(self._joints)))
        around: dict[str, JointSurroundings] = {}
        for number, joint in enumerate(self._joints):
            sun = sun_links[joint.parent]
            if joint.name in given.values:
                rate = given.rates.get(joint.name, 0.0)
                values[:, number] = given.values[joint.name] + after_s * rate
            else:
                around[joint.name] = JointSurroundings(
                    joint=joint,
                    group=tuple(n for n, key in self._keys.items() if key == self._keys[joint.name]),
                    spacecraft=self._spacecraft,
                    purpose=f"{self._where}.{joint.name}",
                    epoch=self._epoch,
                    seed=self._seed,
                    t_s=motion.t_s,
                    indices=motion.indices,
                    sun_direction_carrier=sun,
                    R_eci_from_body=motion.R_eci_from_body,
                )
                values[:, number] = self._laws[joint.name].values(around[joint.name])
            if joint.name in carriers:
                turns = joint.kind == "revolute"
                moved = rotated(sun, joint.axis_body, -values[:, number]) if turns else sun
                sun_links[joint.name] = moved
        return _Values(values, around)

    def _check_limits(self, joint: Joint, values: FloatArray, indices: IntArray) -> None:
        low, high = joint.limits
        beyond = (values < low - _BEYOND) | (values > high + _BEYOND)
        if np.any(beyond):
            row = int(np.argmax(beyond))
            asked = _shown(joint, float(values[row]))
            raise InputError(
                f"{self._where}.{joint.name}: {asked} at frame {indices[row]} is beyond the joint's"
                f" limits, {_shown(joint, low)} to {_shown(joint, high)}"
            )


class CheckedJointLaw(JointLaw):
    """A joint's law whose values and rates are checked; see :func:`checked_values`."""

    def __init__(self, law: JointLaw, name: str, where: str) -> None:
        """where: the key that chooses the law."""
        super().__init__(law.options)
        self._law, self._name, self._where = law, name, where

    def values(self, around: JointSurroundings) -> FloatArray:
        try:
            with failures_named("joint-law", self._name):
                made = self._law.values(around)
        except InputError as error:
            raise InputError(f"{self._where}: {error}") from None
        return checked_values(made, len(around.t_s), self._name)

    def rates(self, around: JointSurroundings) -> FloatArray | None:
        with failures_named("joint-law", self._name):
            made = self._law.rates(around)
        return None if made is None else checked_values(made, len(around.t_s), self._name)


def checked_values(made: object, frames: int, name: str) -> FloatArray:
    """Check that a joint's law returned a number for each frame, and return them.

    Args:
        made: what it returned.
        frames: their number.
        name: of the law.

    Raises:
        ComponentError: The check failed; the message names the law.
    """
    fault = array_fault(made, (frames,), "float64")
    if fault is not None:
        raise ComponentError(f"joint-law {name!r}: the array of values {fault}")
    return np.asarray(made)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and bool(np.isfinite(value))


def _shown(joint: Joint, value: float) -> str:
    return f"{np.degrees(value):.6g} deg" if joint.kind == "revolute" else f"{value:.6g} m"
