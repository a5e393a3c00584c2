"""The built-in components, registered through the same hooks as those of third parties."""

from posse_core._plugins.builtin.flying import posse_controllers, posse_navigators
from posse_core._plugins.builtin.motion import posse_attitude_laws, posse_joint_laws, posse_propagators
from posse_core._plugins.builtin.seeing import posse_annotators, posse_scenes, posse_sensors
from posse_core._plugins.builtin.using import (
    posse_executors,
    posse_refiners,
    posse_subcommands,
    posse_writers,
)

__all__ = [
    "posse_annotators",
    "posse_attitude_laws",
    "posse_controllers",
    "posse_executors",
    "posse_joint_laws",
    "posse_navigators",
    "posse_propagators",
    "posse_refiners",
    "posse_scenes",
    "posse_sensors",
    "posse_subcommands",
    "posse_writers",
]
