"""The renderer of a scenario, which outlives the process that it works in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from posse_core._errors import WorkerLost
from posse_core._imaging.lens import LensRenderer
from posse_core._interfaces.renderer import Renderer
from posse_core._model.scene import Radiance, RenderRequest, Scene
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice, create
from posse_core._simulator.returned import CheckedRenderer

TRIES = 3
"""How often an image is tried when the renderer's process dies."""


def chosen_renderer(registry: Registry, choice: ComponentChoice) -> LensRenderer:
    """The renderer that a user chose, not yet open.

    It is opened again when its process dies, its radiance is checked, and it is seen through the scene's
    lens.
    """
    renderer = ReopeningRenderer(partial(create, registry, "renderer", choice))
    return LensRenderer(CheckedRenderer(renderer, choice.name))


class ReopeningRenderer(Renderer[Any]):
    """Makes and opens the renderer anew when its process dies, and asks it again for the same image.

    An image depends on its request alone, so it is the one that the renderer would have made.
    """

    def __init__(self, make: Callable[[], Renderer[Any]]) -> None:
        self._make = make
        self._renderer = make()
        self._scene: Scene | None = None
        super().__init__(self._renderer.options)

    def open(self, scene: Scene) -> None:
        self._scene = scene
        self._renderer.open(scene)

    def render(self, request: RenderRequest) -> Radiance:
        assert self._scene is not None, "the renderer is not open"
        for tries in range(1, TRIES + 1):
            try:
                return self._renderer.render(request)
            except WorkerLost as error:
                self._renderer.close()
                self._renderer = self._make()
                self._renderer.open(self._scene)
                if tries == TRIES:
                    raise WorkerLost(f"{error}, {TRIES} times") from error
        raise AssertionError("the last try returns or raises")

    def close(self) -> None:
        self._renderer.close()

    def describe(self) -> Mapping[str, str]:
        """What the renderer says of itself."""
        return self._renderer.describe()
