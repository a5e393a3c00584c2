"""Propagators: where target and chaser are."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._model.trajectory import Motion
from posse_core._plugins.component import Component, OptionsT
from posse_core._scenario.orbit import OrbitConfig, RelativeConfig


@dataclass(frozen=True)
class PropagationProblem:
    """What the scenario says of the motion.

    Attributes:
        orbit: the target's orbit, as the user gave it (TLE, elements, or state).
        relative: the chaser's motion relative to it, as the user gave it.
        t_s: (F,) seconds since the orbit's epoch.
        constants: gravity and radii.
    """

    orbit: OrbitConfig
    relative: RelativeConfig
    t_s: FloatArray
    constants: Constants


class Propagator(Component[OptionsT]):
    """Computes the motion of target and chaser."""

    @abstractmethod
    def propagate(self, problem: PropagationProblem) -> Motion:
        """The motion at ``problem.t_s``.

        Raises:
            posse_core._errors.InputError: the problem is outside this model's domain; the message
                says which model to take.
        """
