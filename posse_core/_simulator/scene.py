"""The scene of a scenario: its target, its other bodies and its camera."""

from __future__ import annotations

from posse_core._errors import InputError
from posse_core._model.scene import Body, Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import TargetChoice, create, target_named
from posse_core._scenario.model import Scenario
from posse_core._simulator.returned import built
from posse_core._spacecraft.damage import damaged
from posse_core._spacecraft.materials import with_materials
from posse_core._spacecraft.variation import varied_materials
from posse_core._trajectory.joints import with_laws


def scene_of(scenario: Scenario, registry: Registry) -> Scene:
    """Build the spacecraft of a scenario, damaged where it says so, with those of its joints that laws
    move.

    Raises:
        InputError: a file that the scenario names cannot be used, or a law is given for a joint that
            there is not or that does not move.
        ComponentError: what a scene source built is not a spacecraft.
    """
    known: list[tuple[TargetChoice, Spacecraft]] = []

    def spacecraft(choice: TargetChoice, where: str) -> Spacecraft:
        for other, made in known:
            if other == choice:
                return made
        try:
            made = built(create(registry, "scene", choice), choice.name)
            made = with_materials(made, choice.materials, "materials" if where else "target.materials")
        except InputError as error:
            raise InputError(f"{where}{error}") from None
        known.append((choice, made))
        return made

    target = spacecraft(scenario.target, "")
    if scenario.damage is not None:
        target = damaged(target, scenario.damage, scenario.seed)
    if scenario.variation is not None:
        target = varied_materials(target, scenario.variation, scenario.seed)
    others = tuple(
        Body(
            member,
            with_laws(
                spacecraft(choice, f"bodies.{name}.spacecraft: "),
                config.joints,
                f"bodies.{name}.joints",
            ),
        )
        for name, config in scenario.bodies.items()
        for member, choice in config.members(name)
    )
    return Scene(with_laws(target, scenario.joints), scenario.camera.camera(), others)


def named_craft(name: str, registry: Registry) -> Spacecraft:
    """A spacecraft by its name as 'posse plugins' lists it, or from the folder of its package.

    Raises:
        InputError: it is neither.
        ComponentError: what a scene source built is not a spacecraft.
    """
    choice = target_named(name, registry)
    return built(create(registry, "scene", choice), choice.name)
