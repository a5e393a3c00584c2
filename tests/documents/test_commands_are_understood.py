"""Every command in README and documentation is one that POSSE, make, pip or Python understands.

A shell expands what the pages show (variables, loops, functions), and each program that it would start
is read by its own parser, with all names in it resolved: scenarios, components, keys and their values.
test_commands_run.py runs many of them.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.shell_completion import CompletionItem, ShellComplete
from documents import PAGES, ROOT, Block, commands, read, shell, spans, synopses

from posse_core._cli.common import options_from, read_scenario
from posse_core._cli.keys import key_table
from posse_core._cli.main import posse
from posse_core._evaluation.crosscheck.closed_forms import CLOSED_FORMS
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.built_in_names import built_in_names
from posse_core._scenario.load import load_scenario, scenario_members
from posse_core._scenario.track import read_track_config

TUTORIALS = [page for page in PAGES if page.startswith("docs/tutorials/")]
ELSEWHERE = {"plain": "the renderer of docs/plugins.md, which its tests make"}
"""Names of components that the pages let the reader write → where they are tested."""
BUILT_IN = set(built_in_names())
REGISTRY = load_plugins().registry
MAKEFILE = (ROOT / "Makefile").read_text("utf-8").replace("$(VENV)", ".venv")
PROJECTS = {
    project["name"]: set(project.get("optional-dependencies", {}))
    for path in (ROOT / "pyproject.toml", *ROOT.glob("p*/*/pyproject.toml"))
    for project in [tomllib.loads(path.read_text("utf-8"))["project"]]
}
"""Distribution → its extras."""
PROJECTS["posse"] = set(
    re.findall(r'^ {4}"(\w+)":', (ROOT / "packaging/posse/setup.py").read_text(), re.MULTILINE)
) | {"all"}


@pytest.mark.parametrize("page", [page for page in PAGES if shell(page) or spans(page)])
def test_every_command_is_understood(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where the models are to which a training refers
    for block in shell(page):
        if page in TUTORIALS and block.language == "sh":
            continue  # test_tutorials.py runs it
        found = commands(block, tmp_path)
        assert found, f"{block.name} runs nothing"
        for words in found:
            understand(block, words)
    for block in spans(page):
        for words in commands(block, tmp_path):
            if words[1] == "--help":
                continue  # of posse itself
            if words[0] == "posse" and all(word.startswith("-") for word in words[2:]):
                knows_options(block, words[1], words[2:])  # a command that is only named
            else:
                understand(block, words)


def test_every_synopsis_names_a_command_and_its_options() -> None:
    found = [block for page in PAGES for block in synopses(page) if block.text.startswith("posse")]
    assert len(found) > 20
    for block in found:
        words = re.sub(r"[\[\]…|]|\.\.\.", " ", block.text).split()
        knows_options(block, words[1], [word for word in words[2:] if word.startswith("-")])


def test_what_is_completed_after_tab_is_what_the_page_says() -> None:
    """Lines such as ``posse describe renderer ⇥   blender mitsuba raster``."""
    lines = [line for page in PAGES for line in read(page).splitlines() if "⇥" in line]
    assert len(lines) >= 4
    for line in lines:
        typed, _, offered = line.strip().partition("⇥")
        _, *before, incomplete = typed.split(" ")
        complete = ShellComplete(posse, {}, "posse", "_POSSE_COMPLETE")
        items: list[CompletionItem] = complete.get_completions(before, incomplete)
        prefix = incomplete.rpartition(".")[0] + "." if "." in incomplete else ""
        values = {item.value.rpartition("=")[2] or item.value.removeprefix(prefix) for item in items}
        assert offered.split(), line
        assert values >= set(offered.split()), line  # plugins of others may be installed


def understand(block: Block, words: list[str]) -> None:
    """Refuse a command that its program would not understand."""
    program, *rest = words
    {"posse": posse_command, "make": make_target, "pip": pip_install, "python": python_file}.get(
        program, lambda block, rest: None
    )(block, rest)


def knows_options(block: Block, name: str, options: list[str]) -> None:
    command = posse.get_command(click.Context(posse), name)
    assert command is not None, f"{block.name}: no command {name!r}"
    known = {flag for parameter in command.params for flag in parameter.opts}
    assert known.issuperset(options), f"{block.name}: {name} has no {set(options) - known}"


def posse_command(block: Block, words: list[str]) -> None:
    name, *arguments = words
    command = posse.get_command(click.Context(posse), name)
    assert command is not None, f"{block.name}: no command {name!r}"
    with command.make_context(name, list(arguments), parent=click.Context(posse)) as context:
        for parameter in command.params:
            for value in given(context, parameter):
                offered = {item.value for item in parameter.shell_complete(context, value)}
                assert value in (*offered, *ELSEWHERE), f"{block.name}: {value!r}: {' '.join(words)}"
        read_keys(name, context)


def given(context: click.Context, parameter: click.Parameter) -> Iterator[str]:
    """The names that the words give to a parameter that completes names."""
    value = context.params.get(parameter.name or "")
    completes = getattr(parameter, "_custom_shell_complete", None) is not None
    if completes and parameter.name != "overrides":
        yield from ([value] if isinstance(value, str) else value or ())


def read_keys(name: str, context: click.Context) -> None:
    """Read the keys of ``-o`` as the command would; files of the reader's own are taken for ``aqua``."""
    keys = options_from(context.params.get("overrides") or ())
    if name in ("run", "fly", "preview", "propagate", "manoeuvres"):
        stand_in = "fly-hold" if name == "fly" else "aqua"
        source = context.params["scenario"] or stand_in
        renderer = context.params.get("renderer")
        assert source in BUILT_IN or "/" in source or source.endswith(".yaml") or source.isupper()
        for member in scenario_members(source if source in BUILT_IN else stand_in):
            overrides = context.params.get("overrides") or ()
            checked = read_scenario(member, overrides, **{"renderer.name": renderer})
            assert name != "fly" or checked.flight is not None
    elif name == "crosscheck":
        renderers = REGISTRY.names("renderer")
        for source in context.params["scenarios"]:
            of_scenario = {key: v for key, v in keys.items() if key.split(".")[0] not in renderers}
            assert source in CLOSED_FORMS or load_scenario(source, REGISTRY, of_scenario)
        for key, value in keys.items():
            renderer, _, option = key.partition(".")
            if renderer in renderers:
                REGISTRY.options("renderer", renderer, {option: value})
    elif name == "train":
        if "start" in keys:
            Path(keys["start"]).parent.mkdir(parents=True, exist_ok=True)
            Path(keys["start"]).touch()
        REGISTRY.options("detector", context.params["detector"], keys)
    elif name == "track":
        navigator = context.params["navigator"]
        read_track_config(Path("none.yaml"), keys | ({"navigator.name": navigator} if navigator else {}))
    elif name == "export":
        for key, value in keys.items():
            writer, _, option = key.partition(".")
            REGISTRY.options("writer", writer, {option: value})
    else:  # options of whichever detector made the file
        known = key_table(load_plugins()).components["detector"].values()
        assert all(any(key in options for options in known) for key in keys)


def make_target(block: Block, words: list[str]) -> None:
    for word in words:
        assert "=" in word or re.search(rf"^{re.escape(word)}:", MAKEFILE, re.MULTILINE), block.name


def pip_install(block: Block, words: list[str]) -> None:
    assert words[0] == "install", block.name
    for word in words[1:]:
        name, _, extras = word.rstrip("]").partition("[")
        if name.startswith("posse"):
            assert set(filter(None, extras.split(","))) <= PROJECTS[name], block.name
        elif "/" in name and "://" not in name:  # an address is of an index
            assert (ROOT / name / "pyproject.toml").is_file(), block.name


def python_file(block: Block, words: list[str]) -> None:
    """A file of the repository that has the options, or a module that is run with files of its tests."""
    file, *rest = words
    if file == "-c":
        compile(rest[0], block.name, "exec")
    elif file == "-m":
        paths = [word for word in rest[1:] if "/" in word]
        assert paths or rest[0] != "pytest", block.name
        assert all((ROOT / path).exists() for path in paths), block.name
    else:
        source = (ROOT / file).read_text("utf-8")
        for option in (word for word in rest if word.startswith("--")):
            assert f'"{option}"' in source, f"{block.name}: {file} has no {option}"


def test_environment_variables_that_pages_set_are_read_somewhere() -> None:
    names = {name for page in PAGES for name in re.findall(r"POSSE_[A-Z_]+(?==)", read(page))}
    places = (ROOT / "posse_core", ROOT / "plugins", ROOT / "tests")
    sources = [path.read_text("utf-8") for place in places for path in place.rglob("*.py")]
    assert names
    assert {name for name in names if not any(f'"{name}"' in source for source in sources)} == set()
