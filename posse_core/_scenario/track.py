"""How a dataset's frames are tracked: the keys of a flight that concern navigation, and a start."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from posse_core._constants import Constants
from posse_core._plugins.options import validated
from posse_core._scenario.flight import NavigationConfig, NavigationErrorsConfig
from posse_core._scenario.load import put
from posse_core._scenario.yaml_lines import KeyPath, YamlText


class TrackConfig(NavigationConfig):
    """How a sequence of frames is tracked. The keys of a flight have their meaning there."""

    start: Literal["dispersed", "first-pose"] = Field(
        "dispersed",
        description="what is known before the first reading. dispersed: the true motion with a random"
        " error of errors.start, as in a flight. first-pose: nothing; the position is that of the first"
        " frame with a pose, which is not used for anything else, and the velocity is zero with a"
        " standard deviation of errors.start.velocity_m_s",
    )
    constants: Constants = Field(Constants(), description="physical constants")
    seed: int = Field(0, ge=0, lt=2**63, description="seed of every random draw")


def read_track_config(scenario: Path, overrides: Mapping[str, Any]) -> TrackConfig:
    """How the frames of a dataset are tracked.

    Seed, constants and, of a flight, all that concerns navigation are those of its scenario, unless
    ``overrides`` gives others. Components that made the dataset need not be installed.

    Args:
        scenario: the dataset's ``scenario.yaml``; it may be missing.
        overrides: dotted key, as in ``measurement.source``, → value.

    Raises:
        InputError: the scenario cannot be read, or a key or value is not valid.
    """
    made = YamlText.read(scenario).value if scenario.exists() else {}
    raw = {key: made[key] for key in ("constants", "seed") if key in made}
    flight = made.get("flight") or {}
    raw |= {key: flight[key] for key in NavigationConfig.model_fields if key in flight}
    known = NavigationErrorsConfig.model_fields
    raw["errors"] = {key: value for key, value in raw.get("errors", {}).items() if key in known}
    given = {tuple(key.split(".")): value for key, value in overrides.items()}
    for path, value in sorted(given.items(), key=lambda item: item[0][-1] != "name"):
        put(raw, path, value)

    def where(path: KeyPath) -> str:
        return f"option {'.'.join(str(step) for step in path)}"

    return validated(TrackConfig, raw, where)
