"""What a scenario looks like through each of its cameras: geometry, sky and renderer of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from posse_core._geometry.raycast import RayCaster
from posse_core._imaging.lens import LensRenderer
from posse_core._model.camera import Camera
from posse_core._model.light import Light, LightRequest
from posse_core._model.scene import Scene
from posse_core._scenario.sky import SkyConfig
from posse_core._simulator.light import CraftLight
from posse_core._sky.sky import Sky


class Optics:
    """The cameras of a scenario.

    What a camera needs is made when it is first asked for, and its renderer opened, so a sensor that
    asks for geometry alone opens none.
    """

    def __init__(
        self,
        scene: Scene,
        config: SkyConfig,
        seed: int,
        make_renderer: Callable[[], LensRenderer],
    ) -> None:
        """seed: of the run."""
        self._scene = scene
        self._config = config
        self._seed = seed
        self._make_renderer = make_renderer
        self._caster = RayCaster(scene)
        self._skies: dict[Camera, Sky] = {}
        self._renderers: dict[Camera, LensRenderer] = {}

    def geometry(self, camera: Camera) -> RayCaster:
        """The ray caster of a camera."""
        return self._caster.through(camera)

    def open(self, camera: Camera) -> None:
        """Open a camera's renderer, if it is not open.

        Raises:
            ComponentError: this machine lacks what the renderer needs.
        """
        if camera not in self._renderers:
            renderer = self._make_renderer()
            renderer.open(replace(self._scene, camera=camera))
            self._renderers[camera] = renderer

    def light(self, request: LightRequest) -> Light:
        """Light from sky and craft over an exposure."""
        camera, state = request.camera, request.state
        exposure = request.exposure_s, request.instants
        self.open(camera)
        if camera not in self._skies:
            self._skies[camera] = Sky(self._config, camera, self._seed)
        sky = self._skies[camera]
        craft_light = CraftLight(
            self._renderers[camera], self.geometry(camera), sky, camera, self._seed, request.purpose
        )
        return Light(
            camera,
            sky.look(state, *exposure) if request.sky is None else request.sky,
            craft_light.gather(state, *exposure, request.earthshine),
        )

    def describe(self) -> Mapping[str, str]:
        """What the renderer says of itself."""
        return self._renderers[self._scene.camera].describe()

    def close(self) -> None:
        """Free the renderers; may be called twice."""
        for renderer in self._renderers.values():
            renderer.close()
