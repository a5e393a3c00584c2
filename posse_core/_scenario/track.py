"""How a dataset's frames are tracked: the keys of a flight that concern navigation, and a start."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from posse_core._constants import Constants
from posse_core._errors import InputError
from posse_core._plugins.options import validated
from posse_core._scenario.files import anchored, with_files
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
    text = YamlText.read(scenario) if scenario.exists() else YamlText.of({}, str(scenario))
    made = _mapping(text, text.value)
    flight = _mapping(text, made.get("flight"), "flight")
    errors = _mapping(text, flight.get("errors"), "flight", "errors")
    raw: dict[str, Any] = {key: made[key] for key in ("constants", "seed") if key in made}
    raw |= {key: flight[key] for key in NavigationConfig.model_fields if key in flight}
    raw["errors"] = {
        key: value for key, value in errors.items() if key in NavigationErrorsConfig.model_fields
    }
    given = {tuple(key.split(".")): value for key, value in overrides.items()}

    def in_file(path: KeyPath) -> str:
        return text.where(path if path[0] in made else ("flight", *path))

    for path, value in sorted(given.items(), key=lambda item: item[0][-1] != "name"):
        put(raw, path, value, in_file)

    def where(path: KeyPath) -> str:
        if any(path[:length] in given for length in range(1, len(path) + 1)):
            return f"option {'.'.join(str(step) for step in path)}"
        return in_file(path)

    def file(key: KeyPath, path: Path) -> Path:
        by_option = any(key[:length] in given for length in range(1, len(key) + 1))
        base = Path() if by_option else scenario.parent
        return anchored(path, base, where(key), confined=not by_option)

    return with_files(validated(TrackConfig, raw, where), file)


def _mapping(text: YamlText, value: Any, *path: str) -> dict[str, Any]:
    """The keys at a path of a scenario; none where it has no such key.

    Raises:
        InputError: there is a value in place of keys.
    """
    if value is not None and not isinstance(value, dict):
        raise InputError(f"{text.where(path)}: holds a value, not keys; restore the file from a copy")
    return value or {}
