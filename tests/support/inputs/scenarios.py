"""Scenarios, flights and recipes, and what a command line adds to them."""

from __future__ import annotations

import random
from pathlib import Path

import yaml
from damage import VALUES, damage, damaged_value
from small_recipe import write_recipe
from small_run import BOX_OBJ, SCENARIO

from inputs.kind import Kind
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.load import dump_scenario, load_scenario

SCENARIOS = ("small.yaml", "posse-v1.yaml", "cluster.yaml", "transfer.yaml", "sensors.yaml")


def write_scenarios(folder: Path) -> None:
    registry = load_plugins().registry
    text = SCENARIO.replace("renderer: {name: flat, seconds: 0.05}\n", "")
    (folder / "small.yaml").write_text(text)
    (folder / "box.obj").write_text(BOX_OBJ)
    for name in ("posse-v1", "cluster"):
        (folder / f"{name}.yaml").write_text(dump_scenario(load_scenario(name, registry)))
    value = yaml.safe_load(text)
    value["relative"]["plan"] = {"transfer": {"to_roe_m": [0, 100, 0, 50, 0, 50], "end_s": 20000}}
    (folder / "transfer.yaml").write_text(yaml.safe_dump(value))
    del value["relative"]["plan"]
    value["sensors"] = {
        "side": {"type": "camera", "mount": {"rotation_vector_deg": [0, 5, 0]}, "rate_hz": 0.01},
        "scanner": {"type": "lidar", "mount": {"position_m": [0.3, 0, 0]}},
    }
    (folder / "sensors.yaml").write_text(yaml.safe_dump(value))


WORLDS = ("tracking.yaml", "company.yaml", "worn.yaml")


def write_worlds(folder: Path) -> None:
    """Scenarios with joints, several bodies, damage and varied materials."""
    (folder / "file").touch()
    registry = load_plugins().registry
    for name, scenario in (("tracking", "aqua-tracking"), ("company", "aqua-company")):
        made = load_scenario(scenario, registry, {"times.count": 3})
        (folder / f"{name}.yaml").write_text(dump_scenario(made))
    changed = {
        "target": {"name": "aqua", "materials": {"foil_amber": {"specular": 0.0}}},
        "damage": {"missing_parts": 1, "torn_parts": 1},
        "variation": {
            "per": "frame",
            "materials": {"*": {"brightness": [0.8, 1.2]}, "black_paint": {"pattern": 0.2}},
        },
        "times.count": 3,
    }
    made = load_scenario("aqua", registry, changed)
    (folder / "worn.yaml").write_text(dump_scenario(made))


def world(folder: Path, draw: random.Random) -> list[str]:
    path = folder / draw.choice(WORLDS)
    if draw.random() < 0.8:
        value = yaml.safe_load(path.read_text())
        parts = [key for key in ("bodies", "joints", "damage", "variation", "target") if value.get(key)]
        key = draw.choice(parts)
        value[key] = damaged_value(value[key], draw)
        path.write_text(yaml.safe_dump(value))
    else:
        damage(path, draw)
    return draw.choice((["propagate", path.name, "--out", "t.npz"], ["run", path.name, "--out", "file"]))


def write_flights(folder: Path) -> None:
    (folder / "file").touch()  # a flight that is sound ends here, since it is no folder
    registry = load_plugins().registry
    for name in ("fly-approach", "fly-hold"):
        (folder / f"{name}.yaml").write_text(dump_scenario(load_scenario(name, registry)))


def flight(folder: Path, draw: random.Random) -> list[str]:
    path = folder / draw.choice(("fly-approach.yaml", "fly-hold.yaml"))
    if draw.random() < 0.8:
        value = yaml.safe_load(path.read_text())
        value["flight"] = damaged_value(value["flight"], draw)
        path.write_text(yaml.safe_dump(value))
    else:
        damage(path, draw)
    return ["fly", path.name, "--out", "file"]


def scenario(folder: Path, draw: random.Random) -> list[str]:
    path = folder / draw.choice(SCENARIOS)
    if draw.random() < 0.6:
        value = yaml.safe_load(path.read_text())
        for _ in range(draw.choice((1, 1, 2))):
            value = damaged_value(value, draw)
        path.write_text(yaml.safe_dump(value))
    else:
        damage(path, draw)
    ends = [["propagate", path.name, "--out", "t.npz"], ["manoeuvres", path.name]]
    ends += [["run", path.name, "--out", "box.obj"]]  # ends after its plan: this is a file
    ends += [["crosscheck", path.name, "--renderers", "raster", "--out", "box.obj/page.html"]]
    command = draw.choice(ends)
    if draw.random() < 0.2:
        key = draw.choice(
            ("times.count", "seed", "frames", "propagator", "orbit", "camera.width_px", "x.y.z")
        )
        command += ["-o", f"{key}={draw.choice(VALUES)}".replace("\0", "")]
    return command


def write_recipes(folder: Path) -> None:
    write_recipe(folder)
    value = yaml.safe_load((folder / "recipe.yaml").read_text())
    value["data"]["scenario"]["renderer"] = {"name": "raster"}
    value["boxes"] = {"name": "nano", "epochs": 1}
    value["keypoints"] = {"name": "heatmap", "epochs": 1}
    (folder / "recipe.yaml").write_text(yaml.safe_dump(value))
    (folder / "runs").touch()  # a recipe that is sound ends here, since it is no folder


def recipe(folder: Path, draw: random.Random) -> list[str]:
    path = folder / draw.choice(("recipe.yaml", "recipe.yaml", "recipe.yaml", "box.obj"))
    if path.suffix == ".yaml" and draw.random() < 0.8:
        path.write_text(yaml.safe_dump(damaged_value(yaml.safe_load(path.read_text()), draw)))
    else:
        damage(path, draw)
    return ["recipe", "recipe.yaml"]


KINDS = {
    "scenario": Kind(
        write_scenarios,
        scenario,
        (
            *(f"propagate {name} --out t.npz" for name in SCENARIOS),
            *(f"run {name} --out box.obj" for name in SCENARIOS),
            "manoeuvres transfer.yaml",
            "crosscheck small.yaml --renderers raster --out box.obj/page.html",
        ),
    ),
    "world": Kind(
        write_worlds,
        world,
        tuple(
            f"{command} {name}"
            for name in WORLDS
            for command in ("propagate --out t.npz", "run --out file")
        ),
    ),
    "flight": Kind(
        write_flights, flight, ("fly fly-approach.yaml --out file", "fly fly-hold.yaml --out file")
    ),
    "recipe": Kind(
        write_recipes, recipe, ("recipe recipe.yaml",), keeps=("craft", "decision.json", "steps.json")
    ),
}
