"""Loads scenarios from a file or by name, checks them, and writes them back to YAML."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from posse_core._dataset.layout import INPUTS, LABELS
from posse_core._errors import InputError
from posse_core._model.distortion import BrownConrady
from posse_core._plugins.options import nearest, validated
from posse_core._plugins.registry import Registry
from posse_core._scenario.attitude import LawChoice, Subject, check_law
from posse_core._scenario.bodies import BodyConfig
from posse_core._scenario.built_in_names import BUILT_IN, built_in_names
from posse_core._scenario.component import ComponentChoice
from posse_core._scenario.files import anchored, keys_of, with_files
from posse_core._scenario.model import Scenario
from posse_core._scenario.yaml_lines import KeyPath, YamlText


@dataclass(frozen=True)
class Member:
    """A scenario of a collection.

    Attributes:
        source: its name or the path of its file.
        overrides: dotted key → value by which the collection replaces the scenario's.
    """

    source: str
    overrides: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Its name, or that of its file without the ending."""
        return Path(self.source).stem


def scenario_members(source: str) -> list[Member]:
    """The scenarios of a source: the source itself, or the members of a collection.

    A collection is a YAML file whose key ``members`` lists names or files of scenarios. Its other key,
    ``overrides``, may replace keys of them all.

    Raises:
        InputError: the source cannot be read, or is no such collection.
    """
    text = _read(source)
    if not isinstance(text.value, dict) or "members" not in text.value:
        return [Member(source, {})]
    members, overrides = text.value["members"], text.value.get("overrides", {})
    if not isinstance(members, list) or not members:
        raise InputError(f"{text.where(('members',))}: a collection has a list of scenarios here")
    if not isinstance(overrides, dict):
        raise InputError(f"{text.where(('overrides',))}: give dotted keys and values, as after -o")
    for key in text.value:
        if key not in ("members", "overrides"):
            raise InputError(f"{text.where((key,))}: a collection has the keys members and overrides")
    names = built_in_names()
    paths = [str(m) if m in names else str(Path(source).parent / str(m)) for m in members]
    return [Member(path, {str(key): value for key, value in overrides.items()}) for path in paths]


def load_scenario(
    source: str | Mapping[str, Any],
    registry: Registry,
    overrides: Mapping[str, Any] | None = None,
    base: Path = Path(),
    name: str = "scenario",
) -> Scenario:
    """Read a scenario and check all of it, the options of components included.

    Args:
        source: path of a YAML file, the name of a built-in scenario, or the keys of a scenario. Paths in
            a file are relative to that file, and those in a dataset's do not lead out of the dataset;
            the others are relative to the working directory. In the scenario, all are absolute.
        overrides: dotted key, as in ``renderer.spp``, → value that replaces the scenario's.
        base: the folder that other paths are relative to, in place of the working directory.
        name: of keys that are not in a file, for messages.

    Raises:
        InputError: the scenario is not valid; the message names file, line, key and value in one line.
    """
    text = YamlText.of(source, name) if isinstance(source, Mapping) else _read(source)
    raw = text.value
    if not isinstance(raw, dict):
        raise InputError(f"{text.name}: a scenario is a mapping of keys; see 'posse describe scenario'")
    home = Path(text.name).parent if text.name == source else None
    given = {tuple(key.split(".")): value for key, value in (overrides or {}).items()}
    _drop_former_cameras(raw, given)
    for path, value in sorted(given.items(), key=lambda item: item[0][-1] not in ("name", "law")):
        put(raw, path, value, text.where)

    def where(path: KeyPath) -> str:
        for length in range(len(path), 0, -1):
            if path[:length] in given:
                return f"option {'.'.join(str(step) for step in path)}"
        return text.where(path)

    def file(key: KeyPath, path: Path) -> Path:
        by_option = any(key[:length] in given for length in range(1, len(key) + 1))
        confined = home is not None and _is_dataset(home) and not by_option
        return anchored(path, home or base, where(key), confined=confined)

    _refuse_extremes(raw, (), where)
    for key, camera in _cameras(raw):
        if isinstance(camera.get("calibration"), str):  # read by the checks, which know no folder
            camera["calibration"] = str(file((*key, "calibration"), Path(camera["calibration"])))
    if raw.get("orbit") is None and "name" in _mapping(raw.get("propagator")):
        raw |= _recorded_orbit(raw["propagator"], registry, where, file)
    scenario = _with_complete_options(validated(Scenario, raw, where), registry, where)
    _refuse_unable_writers(scenario, registry, where)
    return with_files(scenario, file)


def parse_override(text: str) -> tuple[str, Any]:
    """Split ``"renderer.spp=64"`` into ``("renderer.spp", 64)``; the value is YAML.

    Raises:
        InputError: the text is not of the form KEY=VALUE.
    """
    key, equals, value = text.partition("=")
    if not equals or not all(key.split(".")):
        raise InputError(f"option -o {text}: write it as key=value, as in -o renderer.spp=64")
    return key, YamlText(value, f"option -o {text}").value


def dump_scenario(scenario: Scenario) -> str:
    """YAML of the whole scenario with its defaults. Loading it gives the same scenario."""
    keys = scenario.model_dump(mode="json")
    for key in ("damage", "flight", "variation"):
        if keys[key] is None:
            del keys[key]
    for key in ("joints", "bodies", "sensors"):
        if not keys[key]:
            del keys[key]
    return yaml.safe_dump(keys, sort_keys=False, allow_unicode=True)


def _read(source: str) -> YamlText:
    names = built_in_names()
    if source in names:
        return YamlText((BUILT_IN / f"{source}.yaml").read_text("utf-8"), f"scenario {source!r}")
    path = Path(source)
    if path.is_file() or path.suffix in (".yaml", ".yml") or "/" in source:
        return YamlText.read(path)
    raise InputError(
        f"no scenario named {source!r}{nearest(source, names) or '.'} Built-in ones are"
        f" {', '.join(names)}; a file's name ends in .yaml"
    )


def put(raw: dict[str, Any], path: tuple[str, ...], value: Any, where: Callable[[KeyPath], str]) -> None:
    """Set a nested key. A component given by its name alone becomes a mapping; naming another component
    drops the options of the former one.

    Raises:
        InputError: a key above it holds a value; ``where`` says for the message where a key stands.
    """
    depth, name_key = _component_at(path)
    current = raw
    for above, step in enumerate(path[:-1], 1):
        inner = current.get(step)
        if isinstance(inner, str):
            inner = {name_key: inner}
        if inner is None:
            inner = {}
        if not isinstance(inner, dict):
            key = ".".join(path)
            raise InputError(f"{where(path[:above])}: holds a value, not keys, so {key} cannot be set")
        current[step] = inner
        current = inner
    if path[depth:] == (name_key,) and current.get(name_key) != value:
        current.clear()
    current[path[-1]] = value


def _component_at(path: tuple[str, ...]) -> tuple[int, str]:
    """How many steps of a key lead to the component that it belongs to, and the step that names one."""
    if path[0] == "bodies":
        key = path[2] if len(path) > 2 else ""
        return (4 if key == "joints" else 3), ("law" if key in ("attitude", "joints") else "name")
    name_key = {"attitude": "law", "joints": "law", "sensors": "type"}.get(path[0])
    return (1, "name") if name_key is None else (2, name_key)


def _drop_former_cameras(raw: dict[str, Any], given: Mapping[tuple[str, ...], Any]) -> None:
    """Empty the keys of each camera for which a published one or a calibration is named: the former
    camera's numbers would hide the latter's."""
    for key, camera in _cameras(raw):
        if any(given.get((*key, name)) is not None for name in ("preset", "calibration")):
            camera.clear()


def _cameras(raw: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    """The mappings of a scenario's raw keys that describe cameras, each with its key."""
    sensors = raw.get("sensors")
    beside = sensors if isinstance(sensors, dict) else {}
    keys = [("camera",), *(("sensors", name, "camera") for name in beside)]
    for key in keys:
        camera: Any = raw
        for step in key:
            camera = camera.get(step) if isinstance(camera, dict) else None
        if isinstance(camera, dict):
            yield key, camera


_SMALLEST, _LARGEST = 1e-40, 1e40
"""No quantity in SI units is beyond these, and powers of those within do not overflow."""


def _refuse_extremes(value: Any, path: KeyPath, where: Callable[[KeyPath], str]) -> None:
    """Refuse numbers that cannot be computed with; NaN and infinity are left to the keys' own checks."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _refuse_extremes(inner, (*path, key), where)
    elif isinstance(value, list | tuple):
        for i, inner in enumerate(value):
            _refuse_extremes(inner, (*path, i), where)
    elif isinstance(value, int | float) and (value < 0 or value > 0) and abs(value) != math.inf:
        if _SMALLEST < abs(value) < _LARGEST:
            return
        raise InputError(
            f"{where(path)}: {str(value)[:40]} is beyond {_SMALLEST:g} to {_LARGEST:g}, which no"
            " quantity in SI units is"
        )


def _mapping(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _recorded_orbit(
    propagator: dict[str, Any],
    registry: Registry,
    where: Callable[[KeyPath], str],
    file: Callable[[KeyPath, Path], Path],
) -> dict[str, Any]:
    """The key ``orbit`` of a scenario without one, from the motion that its propagator reads.

    Returns:
        Nothing for a propagator that computes the motion.
    """
    choice = validated(ComponentChoice, propagator, lambda path: where(("propagator", *path)))
    model = registry.options_model("propagator", choice.name)
    given = validated(model, choice.options, lambda path: where(("propagator", *path)))
    options = with_files(given, lambda key, path: file(("propagator", *key), path))
    first = registry.create("propagator", choice.name, options).first_state()
    if first is None:
        return {}
    r_m, v_m_s = first.r_eci_m.tolist(), first.v_eci_m_s.tolist()
    return {"orbit": {"state_eci": {"epoch_utc": first.epoch.iso(), "r_m": r_m, "v_m_s": v_m_s}}}


def _is_dataset(folder: Path) -> bool:
    """Say whether a folder with a scenario is a dataset, whose scenario may be anyone's."""
    return any((folder / part).is_dir() for part in (INPUTS, LABELS))


def _refuse_unable_writers(scenario: Scenario, registry: Registry, where: Any) -> None:
    """Refuse writers whose formats cannot describe the camera or the target before the run, since they
    work only at its end."""
    camera = scenario.camera.camera()
    lens = camera.distortion
    limits = (
        ("pinhole-only", "pinhole cameras", "camera.distortion", lens is not None),
        (
            "no-rational-lens",
            "lenses without denominator",
            "camera.distortion",
            isinstance(lens, BrownConrady) and lens.is_rational,
        ),
        ("global-shutter-only", "a global shutter", "camera.line_time_s", camera.line_time_s > 0),
        ("no-joints", "rigid spacecraft", "joints", bool(scenario.joints)),
    )
    for i, choice in enumerate(scenario.writers):
        capabilities = registry.spec("writer", choice.name).capabilities
        for capability, supported, key, is_given in limits:
            if is_given and capability in capabilities:
                raise InputError(
                    f"{where(('writers', i, 'name'))}: {choice.name!r} supports only {supported},"
                    f" and {key} is given; leave one of them out"
                )


def _with_complete_options(scenario: Scenario, registry: Registry, where: Any) -> Scenario:
    def complete(kind: str, choice: ComponentChoice, *path: int | str) -> ComponentChoice:
        try:
            model = registry.options_model(kind, choice.name)
        except InputError as error:
            raise InputError(f"{where((*path, choice.key()))}: {error}") from None
        options: BaseModel = validated(model, choice.options, lambda p: str(where((*path, *p))))
        return choice.model_copy(update={"options": keys_of(options)})

    def law(subject: Subject, choice: LawChoice, *path: str) -> ComponentChoice:
        check_law(registry, choice, subject, where((*path, "law")))
        return complete("attitude-law", choice, *path)

    def body(name: str, config: BodyConfig) -> BodyConfig:
        path = ("bodies", name)
        update: dict[str, Any] = {
            "spacecraft": complete("scene", config.spacecraft, *path, "spacecraft"),
            "attitude": law("target", config.attitude, *path, "attitude"),
            "joints": {
                joint: complete("joint-law", choice, *path, "joints", joint)
                for joint, choice in config.joints.items()
            },
        }
        if config.propagator is not None:
            update["propagator"] = complete("propagator", config.propagator, *path, "propagator")
        return config.model_copy(update=update)

    flight = scenario.flight
    if flight is not None:
        chosen: dict[str, Any] = {
            key: complete(key, getattr(flight, key), "flight", key)
            for key in ("navigator", "controller")
        }
        chosen["measurement"] = flight.measurement.model_copy(
            update={
                key: complete(kind, choice, "flight", "measurement", key)
                for key, kind in (("correction", "renderer"), ("refiner", "refiner"))
                if (choice := getattr(flight.measurement, key)) is not None
            }
        )
        flight = flight.model_copy(update=chosen)
    return scenario.model_copy(
        update={
            "flight": flight,
            "target": complete("scene", scenario.target, "target"),
            "propagator": complete("propagator", scenario.propagator, "propagator"),
            "attitude": scenario.attitude.model_copy(
                update={
                    "target": law("target", scenario.attitude.target, "attitude", "target"),
                    "camera": law("camera", scenario.attitude.camera, "attitude", "camera"),
                }
            ),
            "joints": {
                name: complete("joint-law", choice, "joints", name)
                for name, choice in scenario.joints.items()
            },
            "bodies": {name: body(name, config) for name, config in scenario.bodies.items()},
            "renderer": complete("renderer", scenario.renderer, "renderer"),
            "sensors": {
                name: complete("sensor", choice, "sensors", name)
                for name, choice in scenario.sensors.items()
            },
            "annotators": tuple(
                complete("annotator", c, "annotators", i) for i, c in enumerate(scenario.annotators)
            ),
            "writers": tuple(
                complete("writer", c, "writers", i) for i, c in enumerate(scenario.writers)
            ),
        }
    )
