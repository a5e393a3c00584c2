"""Joint laws: how a joint of a spacecraft moves."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

from posse_core._arrays import FloatArray, IntArray
from posse_core._environment.time import Epoch
from posse_core._model.joints import Joint
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.component import Component, OptionsT


@dataclass(frozen=True)
class JointSurroundings:
    """What a joint's law may depend on, for F frames.

    Attributes:
        joint: what the law moves.
        group: names of the joints, this one among them, that the same key of the scenario moves; more
            than one if the key is a pattern.
        spacecraft: the body, with every joint at zero; its joints are those that laws move.
        purpose: how the purpose of every random draw begins; no other joint of the scene has the same.
        epoch: the instant of t_s = 0.
        seed: of the run.
        t_s: (F,) seconds after the epoch.
        indices: (F,) index of each frame, on which its random draws depend.
        sun_direction_carrier: (F, 3) unit vector from the spacecraft to the Sun, in the axes of the link
            that carries the joint. They are the body's axes if no other joint carries it, and those in
            which the joint's ``axis_body`` and ``facing_body`` are given.
        R_eci_from_body: (F, 3, 3) attitude of the body, GCRF axes from body axes.
    """

    joint: Joint
    group: tuple[str, ...]
    spacecraft: Spacecraft
    purpose: str
    epoch: Epoch
    seed: int
    t_s: FloatArray
    indices: IntArray
    sun_direction_carrier: FloatArray
    R_eci_from_body: FloatArray


class JointLaw(Component[OptionsT]):
    """Moves a joint of a spacecraft.

    A frame's value depends on its own row of the surroundings alone, to the bit, and not on what was
    asked for before. Random numbers are drawn by ``random_generator(seed, index, purpose)``.

    The rate of a frame is the difference of the values 1 ms before and after it, for which ``t_s``
    differs, the body is turned by its angular velocity, and all else is as at the frame. So a law has no
    jumps in time, unless it gives rates of its own; that of a revolute joint may jump by whole turns. A
    random value changes from one index to the next and not with time.
    """

    @abstractmethod
    def values(self, around: JointSurroundings) -> FloatArray:
        """Return the joint's values.

        Args:
            around: of F frames; its arrays must not be modified.

        Returns:
            (F,) float64, rad of a revolute joint and m of a prismatic one, within the joint's limits.

        Raises:
            posse_core.InputError: The law cannot move such a joint, or is undefined at a frame; the
                message says what to do instead. The scenario's key is put before it.
        """

    def rates(self, around: JointSurroundings) -> FloatArray | None:
        """Return the joint's rates, for a law that may jump; None: they are differences of its values.

        Args:
            around: of F frames, as for :meth:`values`.

        Returns:
            (F,) float64, rad/s of a revolute joint and m/s of a prismatic one.
        """
        return None
