"""Distributions that pip really installed, good and bad, side by side in fresh processes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from posse_core._plugins.kinds import RESERVED

PACKAGES = Path(__file__).parents[1] / "packages"
LISTING = """
import json, sys
from posse_core._errors import PosseError
from posse_core._plugins.loading import load_plugins

plugins = load_plugins()
print(json.dumps({
    "plugins": [
        {"dist": s.dist, "name": s.name, "state": s.state, "error": s.error, "components": s.components}
        for s in plugins.statuses
    ],
    "renderers": plugins.registry.names("renderer"),
    "propagators": plugins.registry.names("propagator"),
    "heavy": [m for m in ("torch", "bpy", "mitsuba", "drjit", "OpenGL", "pyrender") if m in sys.modules],
}))
"""
BAD = {
    "posse-import-error": ("broken", "ModuleNotFoundError: No module named 'a_library_that_nobody_has'"),
    "posse-wrong-signature": ("incompatible", "'scene'"),
    "posse-taken-name": ("duplicate", "the propagator name 'roe' is taken by plugin 'core'"),
    "posse-other-api": (
        "incompatible",
        "renderer 'earlier' was written for version 1 of the interfaces, but this core has version 2;",
    ),
    "posse-same-entry": ("duplicate", "posse-plain already has a plugin of this name"),
    "posse-raises": ("broken", "posse_writers: RuntimeError: no luck"),
    "posse-misspelt": (
        "incompatible",
        "there is no hook named 'posse_renderer'; did you mean 'posse_renderers'?",
    ),
    "posse-exits": ("broken", "SystemExit: it wants a display"),
    "posse-unmarked": (
        "incompatible",
        "its function 'posse_renderers' is not marked with @posse_core.hookimpl",
    ),
    "posse-nothing": ("incompatible", "it has no function marked with @posse_core.hookimpl"),
    "posse-misspelt-capability": (
        "incompatible",
        "renderer 'hasty': a renderer has no capability 'determinstic'; did you mean 'deterministic'?",
    ),
    "aaa-raster": ("duplicate", "the renderer name 'raster' is reserved for posse-render-raster"),
    "aab-raster": ("duplicate", "the plugin name 'render_raster' is reserved for posse-render-raster"),
}


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all packages of tests/packages that have a pyproject.toml, laid by pip."""
    sources = tmp_path_factory.mktemp("sources")
    target = tmp_path_factory.mktemp("installed")
    folders = sorted(path.parent for path in PACKAGES.glob("*/pyproject.toml"))
    copies = [str(shutil.copytree(folder, sources / folder.name)) for folder in folders]
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--no-cache-dir", "--quiet"]
    subprocess.run(
        [sys.executable, "-m", "pip", "install", *options, "--target", str(target), *copies], check=True
    )
    return target


def python(site: Path, code: str, **env: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path.rstrip(os.pathsep), **env},
        capture_output=True,
        text=True,
        check=False,
    )


def listing(site: Path, **env: str) -> dict[str, Any]:
    process = python(site, LISTING, **env)
    assert process.returncode == 0, process.stderr
    found: dict[str, Any] = json.loads(process.stdout)
    found["plugins"] = {status["dist"]: status for status in found["plugins"]}
    return found


@pytest.fixture(scope="session")
def found(site: Path) -> dict[str, Any]:
    return listing(site)


def test_a_separate_package_adds_a_renderer_and_a_propagator(found: dict[str, Any]) -> None:
    status = found["plugins"]["posse-plain"]
    assert status["state"] == "ok"
    assert set(status["components"]) == {"renderer:plain", "propagator:still"}
    assert "plain" in found["renderers"]
    assert "still" in found["propagators"]


@pytest.mark.parametrize("dist", BAD)
def test_a_bad_package_is_named_with_its_cause(found: dict[str, Any], dist: str) -> None:
    state, cause = BAD[dist]
    status = found["plugins"][dist]
    assert status["state"] == state
    assert cause in status["error"]
    assert "\n" not in status["error"]
    assert status["components"] == []


def test_bad_packages_cost_only_themselves(found: dict[str, Any]) -> None:
    good = {dist for dist, status in found["plugins"].items() if status["state"] == "ok"}
    assert {"posse-core", "posse-plain", "posse-observer", "posse-beside"} <= good
    assert not good & set(BAD)
    assert not {"free", "earlier", "second"} & set(found["renderers"])
    assert {"roe", "thesis"} <= set(found["propagators"])


def test_listing_loads_no_renderer_and_no_deep_learning(found: dict[str, Any]) -> None:
    assert found["heavy"] == []


def test_loading_the_official_plugins_imports_no_heavy_library(tmp_path: Path) -> None:
    code = """
import sys
from posse_core._plugins.loading import load_plugins
load_plugins()
heavy = {"scipy", "cv2", "numpy", "trimesh", "torch", "onnxruntime", "mitsuba", "moderngl", "bpy", "ray"}
print(sorted(heavy & sys.modules.keys()))
"""
    assert python(tmp_path, code).stdout.strip() == "[]"


def test_loading_classes_that_stand_beside_their_hooks_imports_no_heavy_library(site: Path) -> None:
    """NumPy comes with the interfaces; the libraries that read datasets and images do not."""
    code = """
import sys
from posse_core._plugins.loading import load_plugins
load_plugins()
assert {"posse_beside", "posse_core._interfaces.writer"} <= sys.modules.keys()
print(sorted({"scipy", "cv2", "trimesh", "embreex"} & sys.modules.keys()))
"""
    process = python(site, code)
    assert process.stdout.strip() == "[]", process.stderr


def test_an_official_plugin_keeps_its_name(found: dict[str, Any]) -> None:
    """Whoever asks for ``raster`` gets the official one, or none."""
    official = found["plugins"].get("posse-render-raster")
    assert official is None or official["state"] == "ok"
    assert ("raster" in found["renderers"]) == (official is not None)
    assert "unofficial" not in found["renderers"]


WRONG_CLASSES = {
    ("renderer", "writes"): "posse_wrong_class.Writes is not a subclass of posse_core.Renderer",
    ("renderer", "half"): "posse_wrong_class.Half lacks methods of posse_core.Renderer: render",
    ("renderer", "exiting"): "cannot be loaded: SystemExit: 3",
    ("renderer", "absent"): "cannot be loaded: AttributeError",
    ("detector", "boxes"): (
        "posse_wrong_class.Boxes is not a subclass of posse_core.KeypointFinder,"
        " which the capability 'keypoints' asks for"
    ),
    ("subcommand", "plain-function"): "is not an instance of click.Command",
}


@pytest.mark.parametrize(("kind", "name"), [*WRONG_CLASSES, ("renderer", "fails")])
def test_a_class_that_is_not_of_its_kind_is_named(site: Path, kind: str, name: str) -> None:
    code = f"""
from posse_core import ComponentError
from posse_core._plugins.loading import load_plugins
try:
    load_plugins().registry.create({kind!r}, {name!r})
except ComponentError as error:
    print(error)
"""
    said = python(site, code).stdout
    assert said.startswith(f"{kind} {name!r} of plugin 'wrong_class' cannot be ")
    assert WRONG_CLASSES.get((kind, name), "made: RuntimeError: no lamp") in said
    assert said.count("\n") == 1


def test_doctor_names_what_cannot_be_used(site: Path) -> None:
    """Exit code 1, in one line; a class is imported, and nothing is made of it."""
    doctor = "from posse_core._cli.main import main; main(['doctor'])"
    heavy = ",".join(RESERVED)  # official plugins, whose libraries take seconds to import
    process = python(site, doctor, POSSE_DISABLE_PLUGINS=heavy)
    assert process.returncode == 1
    said = process.stderr.strip().splitlines()[-1]
    bad = {"import_error", "exits", "nothing", "taken_name", "misspelt_capability", "aaa"}
    assert all(f"plugin {name}" in said for name in bad)
    assert "renderer half" in said
    assert "observer" not in said
    for fault in WRONG_CLASSES.values():
        assert fault in process.stdout
    assert "no lamp" not in process.stdout
    without = ",".join([heavy, *BAD, "posse-wrong-class"])
    sound = python(site, doctor, POSSE_DISABLE_PLUGINS=without)
    assert sound.returncode == 0, sound.stderr


def test_the_added_components_work(site: Path) -> None:
    code = """
import numpy as np
from posse_core import Constants, Epoch, PropagationProblem, Start, Target
from posse_core._model.camera import PixelBox
from posse_core._model.scene import RenderRequest
from posse_core._plugins.loading import load_plugins
from posse_core.testing import scenes

registry = load_plugins().registry
options = registry.options("renderer", "plain", {"level": 2.5})
renderer = registry.create("renderer", "plain", options)
frame = scenes.frame(t_body_cam_m=(0, 0, 5), sun_direction_body=(0, 0, 1))
image = renderer.render(RenderRequest(frame.craft, PixelBox(1, 2, 3, 4), None, 0))
assert image.radiance_rgb.shape == (4, 3, 3) and (image.radiance_rgb == 2.5).all()
target = Target(np.array([7.1e6, 0, 0]), np.array([0, 7500.0, 0]), Constants())
start = Start.from_rtn(target, np.array([1.0, -20.0, 3.0]), np.ones(3))
problem = PropagationProblem(Epoch.from_iso("2022-01-31"), target, (start,), np.arange(3.0))
motion = registry.create("propagator", "still").propagate(problem)
assert (motion.r_chaser_rtn_m == [1.0, -20.0, 3.0]).all()
"""
    process = python(site, code)
    assert process.returncode == 0, process.stderr


@pytest.mark.parametrize("named", ["plain", "posse-plain"])
def test_a_disabled_plugin_is_not_imported(site: Path, named: str) -> None:
    found = listing(site, POSSE_DISABLE_PLUGINS=f"{named}, import_error")
    assert found["plugins"]["posse-plain"]["state"] == "disabled"
    assert found["plugins"]["posse-import-error"]["state"] == "disabled"
    assert "plain" not in found["renderers"]
    code = LISTING + "\nassert 'posse_plain' not in sys.modules"
    assert python(site, code, POSSE_DISABLE_PLUGINS=named).returncode == 0


def test_strict_mode_raises_and_names_the_plugin(site: Path) -> None:
    process = python(site, LISTING, POSSE_STRICT_PLUGINS="1")
    assert process.returncode != 0
    last = process.stderr.strip().splitlines()[-1]
    assert "ComponentError" in last
    assert any(dist in last for dist in BAD)
    assert listing(site, POSSE_STRICT_PLUGINS="1", POSSE_DISABLE_PLUGINS=",".join(BAD))


def test_naming_a_component_of_a_broken_plugin_tells_why(site: Path) -> None:
    code = """
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins
try:
    load_plugins().registry.create("renderer", "import_error")
except InputError as error:
    print(error)
"""
    told = python(site, code).stdout
    assert "no renderer named 'import_error'" in told
    assert "a_library_that_nobody_has" in told


def test_an_observer_hears_and_one_that_raises_is_a_warning(site: Path) -> None:
    code = """
import warnings
from posse_core import LabelLine
from posse_core._plugins.loading import load_plugins
plugins = load_plugins()
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    plugins.notify("posse_frame_completed", index=3, labels=LabelLine(index=3, spacecraft="aqua"))
print([str(w.message) for w in caught])
"""
    told = python(site, code).stdout
    assert "frame 3 of aqua" in told
    assert "posse_frame_completed of plugin 'observer' raised RuntimeError" in told
