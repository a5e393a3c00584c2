"""The spacecraft of a detector's classes, as far as their meshes are known."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from posse_core._dataset.images import LabelledImages
from posse_core._dataset.layout import SCENARIO
from posse_core._detection.shapes import RefinerOf, Shapes
from posse_core._errors import InputError
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.registry import Registry
from posse_core._refinement.opening import open_refiner
from posse_core._scenario.component import ComponentChoice
from posse_core._scenario.load import load_scenario
from posse_core._simulator.scene import named_craft, scene_of


def built_in_shapes(
    classes: Iterable[str], registry: Registry, refiner: ComponentChoice | None = None
) -> Shapes:
    """The spacecraft of classes whose name is that of an installed spacecraft.

    Args:
        refiner: by which poses are refined; None refines none.
    """
    return Shapes(_built_in(classes, registry), _opener(registry, refiner))


def target_shapes(target: Spacecraft, registry: Registry, refiner: ComponentChoice | None) -> Shapes:
    """One spacecraft, which the detector must know by its name."""
    return Shapes({target.name: target}, _opener(registry, refiner))


def dataset_shapes(
    dataset: LabelledImages, registry: Registry, refiner: ComponentChoice | None = None
) -> Shapes:
    """The spacecraft of a dataset: those of its scenario, else installed ones by their names.

    A spacecraft whose joints move is left out, since its mesh alone does not say where its parts are.
    """
    path = dataset.folder / SCENARIO
    if not path.is_file():
        return built_in_shapes(dataset.classes, registry, refiner)
    scene = scene_of(load_scenario(str(path), registry, {}), registry)
    crafts: dict[str, Spacecraft] = {}
    for craft in scene.bodies:
        crafts.setdefault(craft.name, craft)
    rigid = {name: craft for name, craft in crafts.items() if not craft.joints}
    return Shapes(rigid, _opener(registry, refiner))


def _built_in(classes: Iterable[str], registry: Registry) -> dict[str, Spacecraft]:
    names = set(classes) & set(registry.names("scene"))
    crafts = {}
    for name in sorted(names):
        try:
            crafts[name] = named_craft(name, registry)
        except InputError:  # one that needs options is not known by its name alone
            continue
    return crafts


def _opener(registry: Registry, refiner: ComponentChoice | None) -> RefinerOf | None:
    return None if refiner is None else partial(open_refiner, registry, refiner)
