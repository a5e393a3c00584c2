"""``posse describe``: describes the keys of a scenario or the options of a component."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

import click
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from posse_core._cli import completing
from posse_core._cli.common import echo_json
from posse_core._errors import InputError
from posse_core._plugins.kinds import KINDS, Kind, shown
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import nearest
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice

if TYPE_CHECKING:
    from posse_core._model.joints import Joint


@click.command()
@click.argument("kind", shell_complete=completing.described_kinds)
@click.argument("name", required=False, shell_complete=completing.described_names)
@click.option("--json", "as_json", is_flag=True, help="Print the JSON schema.")
def command(kind: str, name: str | None, as_json: bool) -> None:
    """Describe the keys of a scenario, a recipe or a track, a camera, a kind of component, or one.

    \b
    posse describe scenario            every key of a scenario
    posse describe recipe              every key of a recipe
    posse describe track               the keys of 'posse track'
    posse describe camera speed-plus   a named camera
    posse describe renderer            what renderers are, and which are installed
    posse describe renderer mitsuba    the options of one renderer
    """
    from posse_core._recipe.model import Recipe
    from posse_core._scenario.built_in_names import built_in_names
    from posse_core._scenario.model import Scenario
    from posse_core._scenario.track import TrackConfig

    if kind == "camera":
        _describe_camera(name, as_json)
        return
    registry = load_plugins().registry
    if kind == "scenario":
        model: type[BaseModel] = Scenario
        title = f"A scenario. Built-in ones: {', '.join(built_in_names())}."
    elif kind == "recipe":
        model, title = Recipe, "A recipe, as 'posse recipe' writes and follows it."
    elif kind == "track":
        model, title = TrackConfig, "Keys of 'posse track', to be set by -o."
    elif kind in KINDS:
        if name is None:
            _describe_kind(KINDS[kind], registry, as_json)
            return
        spec = registry.spec(kind, name)
        model = registry.options_model(kind, name)
        claims = (
            f"\n  {word}: {KINDS[kind].capabilities[word].claim}" for word in sorted(spec.capabilities)
        )
        title = f"{kind} {name}: {spec.summary}." + "".join(claims) + "\noptions"
    else:
        known = ["scenario", "recipe", "track", "camera", *KINDS]
        raise InputError(f"describe {kind}: no such kind{nearest(kind, known)} ({', '.join(known)})")
    if as_json:
        echo_json(model.model_json_schema())
        return
    click.echo(title)
    _describe(model, indent="  ")
    if kind == "scene" and not any(field.is_required() for field in model.model_fields.values()):
        _describe_joints(registry, str(name))


def _describe_kind(kind: Kind, registry: Registry, as_json: bool) -> None:
    """Print what a kind of component must provide, and the names of those installed."""
    facts = {
        "hook": kind.hook,
        "interface": shown(kind.interface),
        "conformance": shown(kind.conformance),
    }
    claims = {word: capability.claim for word, capability in kind.capabilities.items()}
    names = registry.names(kind.name)
    if as_json:
        echo_json(
            {"summary": kind.summary, **facts, "capabilities": claims, "installed": names},
        )
        return
    click.echo(f"{kind.name}: {kind.summary}")
    for key, value in facts.items():
        click.echo(f"  {key}: {value}")
    for word, claim in claims.items():
        able = [spec.name for spec in registry.specs(kind.name) if word in spec.capabilities]
        click.echo(f"  capability {word}: {claim} ({', '.join(able) or 'none installed'})")
    click.echo(f"  installed: {', '.join(names) or 'none'}")


def _describe_joints(registry: Registry, name: str) -> None:
    """Print the joints of a spacecraft with the default options."""
    from posse_core._simulator.returned import built

    does = {"revolute": "turns", "prismatic": "slides", "fixed": "does not move"}
    joints = built(registry.create("scene", name), name).joints
    if joints:
        click.echo("joints, moved by the scenario's key joints")
    for joint in joints:
        carried = f", carried by {joint.parent}" if joint.parent else ""
        tracks = "; sun-tracking can turn it" if joint.facing_body is not None else ""
        click.echo(f"  {joint.name}: {does[joint.kind]}{_limits(joint)}{carried}{tracks}")


def _limits(joint: Joint) -> str:
    low, high = joint.limits
    if joint.kind == "fixed" or (low == -math.inf and high == math.inf):
        return ""
    factor, unit = (math.degrees(1), "deg") if joint.kind == "revolute" else (1.0, "m")
    return f" from {factor * low:.6g} to {factor * high:.6g} {unit}"


def _describe_camera(name: str | None, as_json: bool) -> None:
    """Print the keys that a named camera sets, and their source."""
    from posse_core._scenario.presets import PRESETS

    preset = PRESETS.get(name or "")
    if preset is None:
        hint = nearest(name, PRESETS) if name else ""
        wrong = f": no camera named {name!r}{hint}" if name else ": give the name of a camera"
        raise InputError(f"describe camera{wrong} ({', '.join(PRESETS)})")
    keys = {"camera": dict(preset.camera), "sensor": dict(preset.sensor)}
    if as_json:
        echo_json({"source": preset.source, **keys})
        return
    click.echo(f"camera {name}: {preset.source}")
    for block, values in keys.items():
        click.echo(f"  {block}")
        for key, value in values.items():
            click.echo(f"    {key}: {json.dumps(value)}")


def _describe(model: type[BaseModel], indent: str) -> None:
    if not model.model_fields:
        click.echo(f"{indent}no options")
    for line in option_lines(model):
        default = "" if line.default is None else f" [{line.default}]"
        click.echo(f"{indent}{'  ' * line.depth}{line.key}{default}: {line.meaning}")


@dataclass(frozen=True)
class OptionLine:
    """A key of a model, as it is described on the command line and in the documentation.

    Attributes:
        depth: 0 for the model's own keys, 1 for those of a model in one of them, and so on.
        key: the key.
        default: the default as it is written in YAML, or None where there is none to show.
        meaning: one line of documentation.
    """

    depth: int
    key: str
    default: str | None
    meaning: str


def option_lines(model: type[BaseModel], depth: int = 0) -> Iterator[OptionLine]:
    """Yield a model's keys, each followed by those of the models that its value may be."""
    is_choice = issubclass(model, ComponentChoice)  # its name and options are told by the key above
    for key, field in model.model_fields.items():
        if is_choice and key in ComponentChoice.model_fields:
            continue
        values = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
        if len(values) == 1:  # the key selects the model, which the docstring describes
            yield OptionLine(depth, key, None, f"{values[0]}. {_first_sentence(model)}")
            continue
        default = None if field.default is PydanticUndefined else _default(field.default)
        said = field.description or ""
        if not all(str(value) in said for value in values):
            said += f" ({', '.join(map(str, values))})"
        yield OptionLine(depth, key, default, said)
        for nested in _models(field.annotation):
            yield from option_lines(nested, depth + 1)


def _first_sentence(model: type[BaseModel]) -> str:
    """The first paragraph of a model's docstring, in one line."""
    return " ".join((model.__doc__ or "").strip().split("\n\n")[0].split())


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models(part)]


def _default(value: Any) -> str:
    if isinstance(value, BaseModel):
        return _short(value) if isinstance(value, ComponentChoice) else "as below"
    if isinstance(value, tuple) and any(isinstance(item, BaseModel) for item in value):
        return ", ".join(_short(item) for item in value)
    return json.dumps(value)


def _short(value: BaseModel) -> str:
    if isinstance(value, ComponentChoice) and not value.options:
        return value.name
    return json.dumps(value.model_dump(mode="json"))
