"""The attitude laws that a scenario's keys choose."""

from __future__ import annotations

from typing import Any

from posse_core._plugins.loading import load_plugins
from posse_core._scenario.attitude import AttitudeConfig
from posse_core._trajectory.attitude import Laws


def laws_of(**attitude: Any) -> Laws:
    """The laws, as of ``laws_of(target={"law": "spin", "rate_rpm": 3})``."""
    return Laws.of(AttitudeConfig.model_validate(attitude), load_plugins().registry)
