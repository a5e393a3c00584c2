"""The examples of docs/plugins.md, each as the module of a plugin of its own."""

from __future__ import annotations

import importlib
import json
import re
from importlib.metadata import EntryPoint
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from posse_core._frames import unit
from posse_core._model.camera import PixelBox
from posse_core._model.label_line import LabelLine
from posse_core._model.manifest import Manifest
from posse_core._model.scene import RenderRequest, Scene
from posse_core._plugins.kinds import KINDS
from posse_core._plugins.loading import Plugins
from posse_core.testing import (
    AnnotatorConformance,
    AttitudeLawConformance,
    CommandConformance,
    ControllerConformance,
    DetectorConformance,
    ExecutorConformance,
    JointLawConformance,
    NavigatorConformance,
    RefinerConformance,
    RendererConformance,
    SceneSourceConformance,
    SensorConformance,
    WriterConformance,
    scenes,
)
from posse_core.testing.attitude_laws import surroundings
from posse_core.testing.conformance import Conformance
from posse_core.testing.joint_laws import joint_surroundings

TEXT = (Path(__file__).parents[2] / "docs" / "plugins.md").read_text(encoding="utf-8")
EXAMPLES = {
    re.search(r"def (posse_\w+)", code)[1]: code  # type: ignore[index]
    for code in re.findall(r"```python\n(.*?)```", TEXT, flags=re.S)
}
KIND_OF = {kind.hook: kind.name for kind in KINDS.values()}


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Plugins with the core and the example of one hook."""

    def load(hook: str) -> Plugins:
        (tmp_path / f"example_{hook}.py").write_text(EXAMPLES[hook], encoding="utf-8")
        monkeypatch.syspath_prepend(tmp_path)
        plugins = Plugins([EntryPoint("example", f"example_{hook}", "posse")])
        assert plugins.statuses[-1].name == "example"
        assert plugins.statuses[-1].state == "ok", plugins.statuses[-1].error
        return plugins

    return load


def test_every_hook_has_an_example() -> None:
    assert set(EXAMPLES) == {*KIND_OF, "posse_run_started"}


@pytest.mark.parametrize("hook", sorted(KIND_OF))
def test_the_component_can_be_made(load, hook: str) -> None:
    plugins, kind = load(hook), KIND_OF[hook]
    (component,) = plugins.statuses[-1].components
    name = component.removeprefix(f"{kind}:")
    if kind == "subcommand":
        command = plugins.registry.load(kind, name)
        assert isinstance(command, click.Command)
        assert CliRunner().invoke(command).output == "hello\n"
    else:
        plugins.registry.create(kind, name)


def test_the_renderer_and_the_scene_render(load) -> None:
    craft = load("posse_scenes").registry.create("scene", "kite").build()
    renderer = load("posse_renderers").registry.create("renderer", "plain")
    renderer.open(Scene(craft, scenes.camera()))
    frame = scenes.frame(t_body_cam_m=(0, 0, 5), sun_direction_body=(0, 0, 1))
    image = renderer.render(RenderRequest(frame.craft, PixelBox(46, 34, 3, 4), None, 0))
    np.testing.assert_array_equal(image.radiance_rgb, np.ones((4, 3, 3)))


def test_the_renderer_draws_links_and_bodies_where_they_are(load) -> None:
    registry = load("posse_renderers").registry

    class Plain(RendererConformance):
        iou_min = 0.92  # it fills whole pixels, those that an edge touches too

        def renderer(self):
            return registry.create("renderer", "plain")

    Plain().test_silhouette_is_the_ray_casts()
    Plain().test_joints_move_what_they_carry()
    Plain().test_bodies_are_where_they_are()


def test_the_attitude_law_conforms_and_swings(load) -> None:
    registry = load("posse_attitude_laws").registry

    class Librating(AttitudeLawConformance):
        capabilities = registry.spec("attitude-law", "librating").capabilities

        def law(self):
            return registry.create("attitude-law", "librating")

    run_all(Librating())
    around = surroundings("target", np.array([0.0, 100.0, 250.0, 300.0]))
    r, v = around.r_target_eci_m, around.v_target_eci_m_s
    options = registry.options("attitude-law", "librating", {"period_s": 400})
    R = registry.create("attitude-law", "librating", options).attitude(around)
    forward = unit(np.cross(np.cross(r, v), r))
    # Body +z swings forward of the vertical by 10° times the sine of a turn in 400 s.
    swing = np.degrees(np.arcsin(np.sum(R[..., 2] * forward, axis=-1)))
    np.testing.assert_allclose(swing, 10 * np.array([0, 1, -np.sqrt(0.5), -1]), atol=1e-9)


def test_the_joint_law_conforms_and_swings(load) -> None:
    registry = load("posse_joint_laws").registry

    class Swinging(JointLawConformance):
        def law(self):
            return registry.create("joint-law", "swinging")

    run_all(Swinging())
    options = registry.options("joint-law", "swinging", {"amplitude_deg": 8, "period_s": 40})
    values = registry.create("joint-law", "swinging", options).values(
        joint_surroundings(np.array([0.0, 10.0, 25.0, 30.0]))
    )
    np.testing.assert_allclose(np.degrees(values), 8 * np.array([0, 1, -np.sqrt(0.5), -1]), atol=1e-9)


def test_the_refiner_conforms(load) -> None:
    registry = load("posse_refiners").registry

    class Whole(RefinerConformance):
        def refiner(self):
            return registry.create("refiner", "whole")

    for name in (name for name in vars(RefinerConformance) if name.startswith("test_")):
        getattr(Whole(), name)()


def test_the_navigator_conforms(load) -> None:
    registry = load("posse_navigators").registry

    class Hill(NavigatorConformance):
        def navigator(self):
            return registry.create("navigator", "hill")

    run_all(Hill())


def test_the_controller_conforms(load) -> None:
    registry = load("posse_controllers").registry

    class Targeting(ControllerConformance):
        def controller(self):
            return registry.create("controller", "targeting")

    run_all(Targeting())


def test_the_sensor_conforms_and_is_short(load) -> None:
    registry = load("posse_sensors").registry

    class Laser(SensorConformance):
        def sensor(self):
            return registry.create("sensor", "rangefinder")

    run_all(Laser())
    assert len(EXAMPLES["posse_sensors"].strip().splitlines()) <= 60


def test_the_annotator_conforms(load) -> None:
    registry = load("posse_annotators").registry

    class Nearest(AnnotatorConformance):
        def annotator(self):
            return registry.create("annotator", "nearest")

    run_all(Nearest())


def test_the_writer_conforms(load) -> None:
    registry = load("posse_writers").registry

    class Ranges(WriterConformance):
        def writer(self):
            return registry.create("writer", "ranges")

        def images_in(self, folder):
            return json.loads((folder / "ranges.json").read_text())

    run_all(Ranges())


def test_the_detector_conforms(load) -> None:
    registry = load("posse_detectors").registry

    class Everywhere(DetectorConformance):
        capabilities = registry.spec("detector", "everywhere").capabilities

        def detector(self):
            return registry.create("detector", "everywhere")

    run_all(Everywhere())


def test_the_scene_conforms(load) -> None:
    registry = load("posse_scenes").registry

    class Kite(SceneSourceConformance):
        def source(self):
            return registry.create("scene", "kite")

    run_all(Kite())


def test_the_command_conforms(load) -> None:
    registry = load("posse_subcommands").registry

    class Hello(CommandConformance):
        def command(self):
            return registry.load("subcommand", "hello")

    run_all(Hello())


def test_the_executor_conforms(load) -> None:
    registry = load("posse_executors").registry

    class Here(ExecutorConformance):
        in_process = True

        def executor(self, workers):
            return registry.create("executor", "here")

    run_all(Here())


def run_all(case: Conformance) -> None:
    """All tests of a conformance class, as pytest would run them."""
    for name in (name for name in dir(case) if name.startswith("test_")):
        getattr(case, name)()


def test_the_observers_hear(load) -> None:
    plugins = load("posse_run_started")
    plugins.notify("posse_run_started", dataset=Path("d"), frames=2)
    plugins.notify("posse_frame_completed", index=1, labels=LabelLine(index=1, range_m=20.0))
    plugins.notify(
        "posse_run_finished",
        dataset=Path("d"),
        manifest=Manifest(state="complete", frames=2, failed_frames={}, seed=3, sha256={}),
    )
    heard = importlib.import_module("example_posse_run_started").heard
    assert heard == ["2 frames to d", "frame 1: 20.0 m", "finished with seed 3"]
