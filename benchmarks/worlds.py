"""What joints and bodies cost: CPU-seconds of a frame over those of the same frame without them.

``python benchmarks/worlds.py`` prints three ratios for each renderer and for the labels' ray caster:

- *joint*: Aqua with its wing on a joint, which has another angle in each frame, over Aqua welded. The
  angles are within a degree, so that the images are nearly the same.
- *ten bodies*: ten balls of 10,000 triangles over one such ball that covers as many pixels;
- *ten bodies, as many triangles*: the same over one ball of 100,000 triangles.

Both scenes are open in renderers of one process, which take turns frame by frame; the CPU time of the
process and its children counts, and of each frame the least of several rounds. The script needs Linux,
since it reads /proc.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._errors import PosseError
from posse_core._evaluation.crosscheck.settings import ScenarioCase
from posse_core._geometry.raycast import RayCaster
from posse_core._model.craft_state import BodyState, CraftState
from posse_core._model.joints import Articulation
from posse_core._model.scene import Body, RenderRequest, Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.component import ComponentChoice, create
from posse_core._scenario.load import load_scenario
from posse_core._simulator.light import BOX_MARGIN_PX
from posse_core.testing import scenes
from posse_core.testing.stage import CLAY

RENDERERS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("raster", "raster", {}),
    ("mitsuba llvm", "mitsuba", {"variant": "llvm", "threads": 1}),
    ("mitsuba scalar", "mitsuba", {"variant": "scalar", "threads": 1}),
    ("blender", "blender", {"threads": 1, "spp": 64, "adaptive_threshold": 0.0}),
)
RINGS = 50
"""Of a ball, which then has 10,000 triangles."""
MANY_RINGS = 158
"""Of a ball of 100,000 triangles."""
TEN = 10

World = tuple[Scene, Sequence[CraftState]]
Draw = Callable[[int], None]
"""Makes a frame."""


def jointed(frames: int, size_px: tuple[int, int]) -> tuple[World, World]:
    """Aqua with a wing that turns, and welded."""
    keys = {"camera.width_px": size_px[0], "camera.height_px": size_px[1]}
    scenario = load_scenario("aqua-tracking", load_plugins().registry, keys)
    setting = ScenarioCase("aqua-tracking", scenario, "random", frames).build()
    moving, joints = setting.scene, setting.scene.spacecraft.joints
    angles = np.radians(np.linspace(-1.0, 1.0, frames))
    states = [
        replace(
            frame.craft,
            articulation=Articulation(joints, np.full(len(joints), angle), np.zeros(len(joints))),
        )
        for frame, angle in zip(setting.frames, angles, strict=True)
    ]
    welded = replace(moving, spacecraft=moving.spacecraft.welded(()))
    return (moving, states), (welded, [replace(each, articulation=Articulation()) for each in states])


def crowded(frames: int, size_px: tuple[int, int], rings: int = RINGS) -> tuple[World, World]:
    """Ten balls, and one with a number of rings that covers as many pixels."""
    camera = scenes.camera(*size_px)
    ball, large = (
        scenes.sphere("ball", "clay", radius_m=radius_m, rings=count)
        for radius_m, count in ((0.3, RINGS), (0.3 * np.sqrt(TEN), rings))
    )
    materials = {CLAY.name: CLAY}
    small = Spacecraft("ball", (ball,), materials)
    many = Scene(small, camera, tuple(Body(f"ball_{k}", small) for k in range(1, TEN)))
    one = Scene(Spacecraft("ball", (large,), materials), camera)
    places_m = [[0.75 * (k % 5 - 2), 0.75 * (k // 5 - 0.5), 0.1 * k] for k in range(TEN)]
    crowds, singles = [], []
    for number in range(frames):
        turn = Rotation.from_rotvec([0.0, 0.0, 0.1 * number]).as_matrix()
        bodies = [BodyState(turn, turn @ place + [0.0, 0.0, 6.0]) for place in places_m]
        single = scenes.frame(t_body_cam_m=(0.0, 0.0, 6.0), sun_direction_body=(1.0, 0.5, 1.0)).craft
        singles.append(replace(single, R_cam_from_body=turn))
        crowds.append(
            replace(
                single,
                R_cam_from_body=bodies[0].R_cam_from_body,
                t_body_cam_m=bodies[0].t_body_cam_m,
                others=tuple(bodies[1:]),
            )
        )
    return (many, crowds), (one, singles)


def cpu_s() -> float:
    """CPU time of this process and its children, seconds."""
    ticks = 0
    for child in Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="ascii").split():
        stat = Path(f"/proc/{child}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        ticks += sum(map(int, stat[11:15]))
    return time.process_time() + ticks / os.sysconf("SC_CLK_TCK")


def rendering(world: World, name: str, options: dict[str, Any]) -> tuple[Draw, Callable[[], None]]:
    """How a renderer makes a frame of a world, and how it is closed."""
    scene, states = world
    renderer = create(load_plugins().registry, "renderer", ComponentChoice(name=name, options=options))
    renderer.open(scene)
    caster = RayCaster(scene)
    boxes = [caster.box(state).grown(BOX_MARGIN_PX, scene.camera) for state in states]

    def draw(index: int) -> None:
        renderer.render(RenderRequest(states[index], boxes[index], None, 1, index))

    return draw, renderer.close


def casting(world: World) -> tuple[Draw, Callable[[], None]]:
    """How the labels' ray caster makes a frame of a world."""
    caster = RayCaster(world[0])

    def draw(index: int) -> None:
        caster.views(world[1][index])

    return draw, lambda: None


def ratio(ways: Sequence[tuple[Draw, Callable[[], None]]], frames: int, rounds: int) -> str:
    """CPU-seconds per frame of two ways that take turns, and their ratio, in words."""
    least = np.full((len(ways), frames), np.inf)
    for turn in range(rounds + 1):  # the first one compiles
        for index in range(frames):
            for way, (draw, _) in enumerate(ways):
                start = cpu_s()
                draw(index)
                if turn:
                    least[way, index] = min(least[way, index], cpu_s() - start)
    for _, close in ways:
        close()
    new, old = least.mean(axis=1)
    return f"{new / old:>8.3f}{new:>10.3f}{old:>10.3f}"


@click.command()
@click.option("--frames", default=4, show_default=True, type=click.IntRange(min=2))
@click.option("--rounds", default=4, show_default=True, type=click.IntRange(min=1))
@click.option("--size", "size_px", default=(640, 480), show_default=True, type=(int, int))
@click.option("--only", help="One renderer of the table, by its title.")
def main(frames: int, rounds: int, size_px: tuple[int, int], only: str | None) -> None:
    """Measure all installed renderers."""
    for title, worlds in (
        ("joint", jointed(frames, size_px)),
        ("ten bodies", crowded(frames, size_px)),
        ("ten, as many triangles", crowded(frames, size_px, MANY_RINGS)),
    ):
        click.echo(f"{title:<24}{'ratio':>8}{'s, with':>10}{'without':>10}")
        if only is None:
            click.echo(f"{'ray caster':<24}{ratio([casting(w) for w in worlds], frames, rounds)}")
        for name, renderer, options in RENDERERS:
            if only not in (None, name):
                continue
            try:
                ways = [rendering(world, renderer, options) for world in worlds]
            except PosseError as error:
                click.echo(f"{name}: {error}")
                continue
            click.echo(f"{name:<24}{ratio(ways, frames, rounds)}")


if __name__ == "__main__":
    main()
