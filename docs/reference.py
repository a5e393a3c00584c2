"""Writes the pages of the site that follow from the code: the public face, components and commands.

Sphinx calls this before each build (conf.py). The components are those of the installed plugins.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from pydantic import BaseModel

import posse_core
from posse_core._cli.describe import option_lines
from posse_core._cli.main import posse
from posse_core._plugins.component import Component
from posse_core._plugins.kinds import KINDS, Kind, import_target, shown
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import Options
from posse_core._plugins.registry import ComponentSpec, Registry
from posse_core._recipe.model import Recipe
from posse_core._scenario.model import Scenario
from posse_core._scenario.track import TrackConfig

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "docs" / "generated"
ELSEWHERE = {
    ROOT / "README.md": PAGES / "start.md",
    ROOT / "CHANGELOG.md": PAGES / "changelog.md",
    ROOT / "CONTRIBUTING.md": PAGES / "contributing.md",
    **{path: PAGES / path.name for path in sorted(ROOT.glob("plugins/*/docs/*.md"))},
}
"""Pages that are kept outside docs → where the site has them."""
_LINK = re.compile(r"\]\((?P<path>[^)#:\s]+)(?P<rest>#[^)\s]*)?\)")
_ROLE = re.compile(r"(?::\w+:`~?(?P<role>[^`]+)`|``(?P<code>[^`]+)``)")
TITLES = {
    "_api": "Functions of every day",
    "_arrays": "Types of arrays",
    "_dataset": "Datasets",
    "_detection": "Detection",
    "_dynamics": "Orbits",
    "_environment": "Time",
    "_errors": "Errors",
    "_evaluation": "Evaluation",
    "_files": "Files",
    "_interfaces": "What a component must do",
    "_model": "Records",
    "_plugins": "Plugins",
    "_run": "Runs",
    "_scenario": "Scenarios",
    "_simulator": "The simulator",
}
"""Titles of the API's pages by the package that the names come from; others go to a last page."""
REST = "Constants, geometry and randomness"


def write() -> None:
    """Write all pages into PAGES; a page that has not changed is left, so Sphinx skips it."""
    registry = load_plugins().registry
    pages = dict(_api_pages())
    for kind in KINDS.values():
        pages[f"kind-{kind.name}"] = "\n".join(_kind_page(kind, registry))
    pages["scenario"] = "\n".join(_model_page("Keys of a scenario", Scenario))
    pages["recipe"] = "\n".join(_model_page("Keys of a recipe", Recipe))
    pages["track"] = "\n".join(_model_page("Keys of a track", TrackConfig))
    pages["commands"] = "\n".join(_commands_page())
    pages["components"] = _contents(
        "Components by kind",
        "What a plugin can bring, and the options of every component that is built in or in a plugin of "
        "this repository. [Writing a plugin](../plugins.md) says how to bring one.",
        [f"kind-{kind}" for kind in KINDS],
    )
    for path, page in ELSEWHERE.items():
        pages[page.stem] = relinked(path.read_text("utf-8"), path.parent, PAGES).rstrip()
    PAGES.mkdir(exist_ok=True)
    for stale in {path.stem for path in PAGES.glob("*.md")} - pages.keys():
        (PAGES / f"{stale}.md").unlink()
    for name, text in pages.items():
        path = PAGES / f"{name}.md"
        if not path.exists() or path.read_text("utf-8") != text + "\n":
            path.write_text(text + "\n", "utf-8")


def relinked(text: str, source: Path, folder: Path) -> str:
    """Markdown of a file in ``source`` with its links as those of a page in ``folder``."""

    def link(found: re.Match[str]) -> str:
        target = (source / found["path"]).resolve()
        if not target.exists():
            return found[0]
        return f"]({os.path.relpath(ELSEWHERE.get(target, target), folder)}{found['rest'] or ''})"

    return _LINK.sub(link, text)


def public_names() -> dict[str, list[str]]:
    """The names of ``posse_core.__all__`` by the title of the page that has them."""
    stub = ast.parse((ROOT / "posse_core/__init__.pyi").read_text("utf-8"))
    found: dict[str, list[str]] = {}
    for node in stub.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            title = TITLES.get(node.module.split(".")[0], REST)
            found.setdefault(title, []).extend(alias.name for alias in node.names)
    return found


def _api_pages() -> Iterator[tuple[str, str]]:
    names = public_names()
    pages = []
    for title in [*TITLES.values(), REST]:
        page = "api-" + title.lower().replace(",", "").replace(" ", "-")
        blocks = [f"# {title}", *map(_documented, sorted(names[title], key=str.lower))]
        pages.append((page, "\n\n".join(blocks)))
    kit = ["# The conformance kit", _directive("automodule", "posse_core.testing", members=False)]
    kit += [_documented(f"testing.{name}") for name in posse_core.testing.__all__]
    pages.append(("api-testing", "\n\n".join(kit)))
    pages.insert(0, ("api-flows", "\n".join(_flows_page())))
    yield from pages
    yield (
        "api",
        _contents(
            "API",
            "Everything public of `import posse_core as posse`. What is not here is private: its "
            "modules begin with an underscore and change without notice.",
            [page for page, _ in pages],
        ),
    )


def records() -> dict[str, list[str]]:
    """The public names of what flows, by the title of the page that documents them: records, and what
    else the methods of components take or return."""
    asked = set(re.findall(r"\w+", " ".join(_signatures().values())))
    found: dict[str, list[str]] = {}
    for title, names in public_names().items():
        for name in sorted(names, key=str.lower):
            thing: Any = getattr(posse_core, name)
            if not inspect.isclass(thing) or issubclass(thing, (Component, Options, BaseException)):
                continue
            if dataclasses.is_dataclass(thing) or issubclass(thing, (BaseModel, tuple)) or name in asked:
                found.setdefault(title, []).append(name)
    return found


def _signatures() -> dict[str, str]:
    """Kind → the annotations of the methods of its public interfaces."""
    found = dict.fromkeys(KINDS, "")
    for name in posse_core.__all__:
        thing: Any = getattr(posse_core, name)
        if inspect.isclass(thing) and issubclass(thing, Component):
            methods = [method for _, method in inspect.getmembers(thing, inspect.isfunction)]
            for kind in KINDS.values():
                if issubclass(thing, import_target(kind.interface)):
                    found[kind.name] += " ".join(str(inspect.signature(each)) for each in methods)
    return found


_FLOWS = """\
Everything that one part of POSSE hands to another has a type. A record is frozen: what got one can keep
it, and nobody changes it. The last column has the kinds of component whose methods take or return it;
[how data flows](../design.md#how-data-flows) shows the way from a scenario to a frame."""


def _flows_page() -> Iterator[str]:
    signatures = _signatures()
    yield from ("# What flows", "", _FLOWS)
    for title, names in records().items():
        yield from ("", f"## {title}", "", "| what | is | components |", "|---|---|---|")
        for name in names:
            lines = (inspect.getdoc(getattr(posse_core, name)) or "").partition("\n\n")[0].split()
            said = _ROLE.sub(_as_code, re.split(r"(?<=\w\w[.)])\s", " ".join(lines))[0].rstrip("."))
            used = ", ".join(
                f"[{kind}](kind-{kind}.md)"
                for kind, text in signatures.items()
                if re.search(rf"\b{name}\b", text)
            )
            yield f"| {_link(f'posse_core.{name}')} | {said.replace('|', chr(92) + '|')} | {used} |"


def _as_code(found: re.Match[str]) -> str:
    """reStructuredText's role or code as Markdown's code."""
    return f"`{found['code'] or found['role'].rpartition('.')[2]}`"


def _documented(name: str) -> str:
    """The directive that documents a public name from its docstring."""
    found: Any = posse_core
    for attribute in name.split("."):
        found = getattr(found, attribute)
    full = f"posse_core.{name}"
    if inspect.ismodule(found):
        return _directive("automodule", full)
    if inspect.isclass(found):
        kind = "autoexception" if issubclass(found, BaseException) else "autoclass"
        return _directive(kind, full)
    if inspect.isfunction(found):
        return _directive("autofunction", full, members=False)
    return f"```{{py:data}} {full}\n:value: {found!r}\n```"


_MEMBERS = """
   :members:
   :inherited-members: object, BaseModel, BaseException, Exception
   :exclude-members: model_config"""


def _directive(name: str, argument: str, members: bool = True) -> str:
    return f"```{{eval-rst}}\n.. {name}:: {argument}{_MEMBERS if members else ''}\n```"


def _contents(title: str, said: str, pages: list[str]) -> str:
    return "\n".join([f"# {title}", "", said, "", "```{toctree}", ":maxdepth: 1", "", *pages, "```"])


def _kind_page(kind: Kind, registry: Registry) -> Iterator[str]:
    """What a kind of component must do, and the options of each that is installed."""
    specs = sorted(registry.specs(kind.name), key=lambda spec: spec.name)
    yield from (f"# {kind.name}", "", f"A component of this kind {kind.summary}.", "")
    yield f"- A plugin returns its records by the hook `{kind.hook}`."
    what = "It is an instance" if kind.name == "subcommand" else "Its class is a subclass"
    yield f"- {what} of {_link(kind.interface)}."
    yield f"- Its tests subclass {_link(kind.conformance)}; see [tests](../plugins.md#tests)."
    if kind.capabilities:
        yield from ("", "| capability | what it claims | components that have it |", "|---|---|---|")
        for word, capability in kind.capabilities.items():
            able = ", ".join(f"`{spec.name}`" for spec in specs if word in spec.capabilities)
            yield f"| `{word}` | {capability.claim} | {able or 'none here'} |"
    for spec in specs:
        yield from ("", f"## {spec.name}", "", f"{_sentence(spec.summary)}{_claims(spec)}", "")
        if kind.name == "subcommand":
            yield f"[Its options](commands.md#posse-{spec.name})."
        else:
            yield from _options(registry.options_model(kind.name, spec.name))


def _link(target: str) -> str:
    name = shown(target)
    return f"{{py:obj}}`{name}`" if name.startswith("posse_core") else f"`{name}`"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:].rstrip(".") + "."


def _claims(spec: ComponentSpec) -> str:
    words = ", ".join(f"`{word}`" for word in sorted(spec.capabilities))
    return f" Capabilities: {words}." if words else ""


def _model_page(title: str, model: type[BaseModel]) -> Iterator[str]:
    yield from (f"# {title}", "")
    yield f"As `posse describe {title.split()[-1]}` prints them, with their defaults in parentheses."
    yield ""
    yield from _options(model)


def _options(model: type[BaseModel]) -> Iterator[str]:
    if not model.model_fields:
        yield "It has no options."
    for line in option_lines(model):
        default = "" if line.default is None else f" (`{line.default}`)"
        yield f"{'  ' * line.depth}- `{line.key}`{default}: {_plain(line.meaning)}"


def _plain(text: str) -> str:
    """Text that Markdown shows as it is."""
    return "".join(f"\\{char}" if char in "\\*_[]<>{}$|`#~" else char for char in text)


def _commands_page() -> Iterator[str]:
    yield from ("# Commands", "", "What `posse COMMAND --help` prints.", "")
    with click.Context(posse, info_name="posse") as context:
        yield from ("```text", context.get_help(), "```")
        for name in posse.list_commands(context):
            command = posse.get_command(context, name)
            assert command is not None
            with click.Context(command, info_name=name, parent=context) as inner:
                yield from ("", f"## posse {name}", "", "```text", inner.get_help(), "```")
