"""What shells are offered, and what they make of it."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pexpect
import pytest
import yaml
from click.shell_completion import ShellComplete
from command import run_posse

from posse_core._cli.keys import Key, key_table
from posse_core._cli.main import posse
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.built_in_names import BUILT_IN, built_in_names
from posse_core._scenario.load import load_scenario

PROMPT = "READY> "
BY = {
    "bash": (["--norc", "--noprofile", "-i"], f"PS1='{PROMPT}'; bind 'set enable-bracketed-paste off'"),
    "zsh": (
        ["-f", "-i"],
        f"PS1='{PROMPT}'; unsetopt zle_bracketed_paste; autoload -U compinit; compinit -u -D",
    ),
    "fish": (["--no-config", "-i"], f"function fish_prompt; printf '{PROMPT}'; end"),
}
"""Shell → its arguments, and what makes its prompt known."""


@pytest.fixture(autouse=True, scope="module")
def _own_cache(tmp_path_factory: pytest.TempPathFactory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


def offered(*words: str) -> list[str]:
    """What may stand for the last word."""
    shell = ShellComplete(posse, {}, "posse", "_POSSE_COMPLETE")
    return [item.value for item in shell.get_completions(list(words[:-1]), words[-1])]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("prev",), ["preview"]),
        (("run", "aqua-t"), ["aqua-tracking", "aqua-t"]),  # the latter stands for files
        (("run", "--renderer", "m"), ["mitsuba"]),
        (("run", "", "--renderer", "m"), ["mitsuba"]),  # an empty word is refused when the command runs
        (("run", "--executor", "l"), ["local"]),
        (("export", "d", "--format", "co"), ["coco", "colmap"]),
        (("export", "d", "--format", "hf", "-o", ""), ["hf."]),
        (("export", "d", "--format", "coco", "-o", ""), []),
        (("export", "d", "-o", "hf.l"), ["hf.licence="]),
        (("train", "d", "--detector", ""), ["heatmap", "nano", "sdn"]),
        (("import-poses", "x.json", "--target", "a"), ["aqua", "arm", "a"]),  # the last: any file
        (("track", "d", "--navigator", "u"), ["ukf"]),
        (("describe", "rend"), ["renderer"]),
        (("describe", "renderer", "ra"), ["raster"]),
        (("describe", "camera", "speed-"), ["speed-plus"]),
        (("describe", "scenario", ""), []),
        (("collect", "d", "--drop", "da"), ["dark"]),
        (("eval", "d", "--part", "t"), ["train", "test"]),
        (("partition", "d", "--by", ""), ["frame", "sequence"]),
        (("crosscheck", "--renderers", "raster,m"), ["raster,mitsuba"]),
        (("completion", ""), ["bash", "zsh", "fish"]),
    ],
)
def test_names_are_offered(words: tuple[str, ...], expected: list[str]) -> None:
    assert offered(*words) == expected


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("run", "-o", "camera.hf"), ["camera.hfov_deg="]),
        (("run", "-o", "renderer"), ["renderer.", "renderer="]),
        (("run", "-o", "renderer=r"), ["renderer=raster"]),
        (("run", "-o", "camera.preset=speed-"), ["camera.preset=speed-plus"]),
        (("run", "-o", "camera.distortion_model=f"), ["camera.distortion_model=fisheye"]),
        (("run", "-o", "relative.design.name=f"), ["relative.design.name=fly-around"]),
        (("run", "-o", "attitude.target.law=sun"), ["attitude.target.law=sun-pointing"]),
        (
            ("run", "--renderer", "raster", "-o", "renderer.s"),
            ["renderer.samples_per_axis=", "renderer.shadow_map_px="],
        ),
        (("run", "-o", "renderer=raster", "-o", "renderer.sp"), []),
        (("run", "-o", "renderer.name=mitsuba", "-o", "renderer.sp"), ["renderer.spp="]),
        (("run", "-o", "nothing.such"), []),
        (("run", "-o", "seed.x"), []),
        (("run", "-o", "nothing=1"), []),
        (("fly", "-o", "flight.measurement.correction=ras"), ["flight.measurement.correction=raster"]),
        (("track", "d", "-o", "start=f"), ["start=first-pose"]),
        (("crosscheck", "-o", "raster.sa"), ["raster.samples_per_axis="]),
        (("crosscheck", "-o", "renderer"), []),
    ],
)
def test_keys_and_values_are_offered(words: tuple[str, ...], expected: list[str]) -> None:
    assert offered(*words) == expected


def test_every_option_that_takes_a_component_or_keys_is_completed() -> None:
    registry = load_plugins().registry
    taken = [
        (command, option.opts[0])
        for command in registry.names("subcommand")
        for option in registry.load("subcommand", command).params
        if option.metavar == "KEY=VALUE" or "'posse plugins' lists" in str(getattr(option, "help", ""))
    ]
    assert ("run", "--renderer") in taken
    assert ("run", "-o") in taken
    assert [option for option in taken if not offered(*option, "")] == []


def _paths(keys: dict[str, object], known: dict[str, Key], before: str = "") -> list[str]:
    """The dotted keys of a scenario's file, as deep as the table of keys knows them."""
    found = []
    for name, value in keys.items():
        inner = known.get(name)
        if isinstance(value, dict) and inner is not None and inner.keys:
            found += _paths(value, dict(inner.keys), f"{before}{name}.")
        else:
            found.append(f"{before}{name}")
    return found


@pytest.mark.parametrize("name", built_in_names())
def test_every_key_of_the_built_in_scenarios_is_offered(name: str) -> None:
    written = yaml.safe_load((BUILT_IN / f"{name}.yaml").read_text("utf-8"))
    if "members" in written:
        pytest.skip("a collection has no keys")
    for path in _paths(written, dict(key_table(load_plugins()).scenario)):
        assert {f"{path}=", f"{path}."} & set(offered("run", "-o", path)), path


def test_offered_values_are_valid() -> None:
    registry = load_plugins().registry
    for block in ("sensor", "sky"):
        for name, key in key_table(load_plugins()).scenario[block].keys.items():
            for value in key.values:
                load_scenario("aqua", registry, {f"{block}.{name}": yaml.safe_load(value)})


def test_a_path_to_every_component_that_a_scenario_chooses_knows_its_kind() -> None:
    table = key_table(load_plugins())

    def kinds(keys: dict[str, Key]) -> set[str]:
        inner = (kinds(dict(key.keys)) for key in keys.values())
        return {key.kind for key in keys.values() if key.kind}.union(*inner)

    found = kinds(dict(table.scenario)) | kinds(dict(table.track))
    assert found == {
        "scene",
        "propagator",
        "renderer",
        "attitude-law",
        "refiner",
        "navigator",
        "controller",
    }


def test_keys_are_read_anew_when_a_file_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    table = key_table(load_plugins())
    (path,) = (tmp_path / "posse").iterdir()
    kept = json.loads(path.read_text("utf-8"))
    assert key_table(load_plugins()) == table
    for spoilt in (
        {**kept, "files": dict.fromkeys(kept["files"], 1), "scenario": {}},
        {**kept, "plugins": ["posse-core 0.0.1 ok"], "scenario": {}},
        {**kept, "files": {"/no/such/file.py": 1}, "scenario": {}},
        ["no table"],
    ):
        path.write_text(json.dumps(spoilt), "utf-8")
        assert key_table(load_plugins()) == table


def test_completing_imports_no_numerical_library_and_no_scenario() -> None:
    offered("run", "-o", "")  # keeps the keys in the cache
    code = """
import sys
from posse_core._cli.main import posse
from click.shell_completion import ShellComplete
shell = ShellComplete(posse, {}, "posse", "_POSSE_COMPLETE")
for words in ([], ["run"], ["run", "-o"], ["crosscheck"], ["run", "--renderer"]):
    assert shell.get_completions(words, ""), words
heavy = ["casadi", "cv2", "embreex", "erfa", "scipy", "sgp4", "trimesh", "posse_core._scenario.model"]
print([module for module in heavy if module in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("shell", BY)
def test_a_shell_completes_what_is_typed(shell: str, tmp_path: Path) -> None:
    program = shutil.which(shell)
    if program is None:
        assert not os.environ.get("POSSE_REQUIRE_SHELLS"), f"there is no {shell}"
        pytest.skip(f"there is no {shell}")
    (tmp_path / "dataset-of-mine").mkdir()
    (tmp_path / "my-scenario.yaml").touch()
    code, script, error = run_posse("completion", shell)
    assert (code, error) == (0, "")
    (tmp_path / "script").write_text(script, "utf-8")
    arguments, prompt = BY[shell]
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    typed = pexpect.spawn(
        program,
        arguments,
        cwd=str(tmp_path),
        env={**os.environ, "PATH": path, "TERM": "dumb", "HOME": str(tmp_path)},
        encoding="utf-8",
        timeout=60,
        dimensions=(50, 200),
    )
    for line in (prompt, "source ./script"):
        typed.sendline(line)
        typed.expect(re.escape(PROMPT))
    for begun, whole in {
        "posse prev": "posse preview ",
        "TZ=UTC posse prev": "TZ=UTC posse preview ",
        "true; posse prev": "true; posse preview ",
        "posse run aqua-t": "posse run aqua-tracking ",
        "posse run my-s": "posse run my-scenario.yaml ",
        "posse validate datas": "posse validate dataset-of-mine/",
        "posse run -o camera.hf": "posse run -o camera.hfov_deg=",
        "posse run -o sky.sta": "posse run -o sky.stars.",
        "posse run -o renderer.name=ras": "posse run -o renderer.name=raster ",
        "posse run -o seed=4 --renderer ras": "posse run -o seed=4 --renderer raster ",
    }.items():
        typed.send(f'{begun}\tZ\x01echo "<\x05>"\r')
        typed.expect(r"\n<([^\r\n]*)Z>")
        assert typed.match[1] == whole
    typed.sendline("exit")
    typed.close()
