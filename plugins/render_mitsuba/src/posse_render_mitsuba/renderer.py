"""The renderer ``mitsuba``: chooses the Mitsuba variant and renders frames with it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import metadata

import numpy as np

from posse_core import ComponentError, Radiance, Renderer, RenderRequest, Scene
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.passes import Passes
from posse_render_mitsuba.variants import Choice, choose, load_library
from posse_render_mitsuba.wavefront import Wavefront
from posse_render_mitsuba.world import Place

DARKEST_W_M2_SR = 1e-20
"""A sky that is darker than this everywhere is left out: Mitsuba divides by the map's total light in
single precision, which would overflow."""


class MitsubaRenderer(Renderer[MitsubaOptions]):
    """Path tracing with Mitsuba 3: see :mod:`posse_render_mitsuba.passes` for the scalar variant and
    :mod:`posse_render_mitsuba.wavefront` for the others."""

    def __init__(self, options: MitsubaOptions) -> None:
        super().__init__(options)
        self._choice: Choice | None = None
        self._scene: Scene | None = None
        self._painter: Passes | Wavefront | None = None

    def open(self, scene: Scene) -> None:
        camera = scene.camera
        if not np.isclose(camera.fx_px, camera.fy_px, rtol=1e-9):
            raise ComponentError(
                f"mitsuba renders square pixels only: fx is {camera.fx_px:g} px, fy {camera.fy_px:g} px;"
                " choose a camera with fx = fy, or another renderer"
            )
        self._choice = choose(self.options.variant)
        if self._choice.library:
            load_library(self._choice.library)
        self._scene = scene
        self._activate()
        painter = Passes if self._choice.variant == "scalar_rgb" else Wavefront
        self._painter = painter(scene, self.options)

    def render(self, request: RenderRequest) -> Radiance:
        if self._scene is None or self._painter is None:
            raise ComponentError("mitsuba: render was called before open")
        self._activate()
        if request.environment is not None and request.environment.radiance_rgb.max() < DARKEST_W_M2_SR:
            request = replace(request, environment=None)
        place = Place.of(request.craft, self._scene.link_radii_m)
        image = self._painter.draw(place, request)
        if not np.isfinite(image).all():
            raise ComponentError(
                f"mitsuba: frame {request.index} has radiance that is not finite, probably because of a"
                " material with a roughness near 0; raise the roughness or try another seed"
            )
        return Radiance(
            request.box,
            radiance_rgb=image[..., :3].astype(np.float32),
            coverage=np.clip(image[..., 3], 0, 1).astype(np.float32),
        )

    def close(self) -> None:
        self._painter = None
        self._scene = None

    def describe(self) -> Mapping[str, str]:
        import mitsuba as mi

        if self._choice is None:
            return {"mitsuba": str(mi.__version__)}
        facts = {"mitsuba": str(mi.__version__), "variant": self._choice.variant}
        if self._choice.library:
            facts["libllvm"] = self._choice.library
        if self._choice.note:
            facts["note"] = self._choice.note
        return facts

    @classmethod
    def doctor(cls, options: MitsubaOptions) -> Sequence[tuple[str, bool, str]]:
        """Mitsuba's version and the variant that works on this machine, or why none does; see
        :meth:`Renderer.doctor`."""
        version = ("mitsuba", True, metadata.version("mitsuba"))
        try:
            choice = choose(cls(options).options.variant)
        except ComponentError as error:
            return [version, ("variant", False, str(error))]
        detail = ", ".join(filter(None, (choice.variant, choice.library, choice.note)))
        return [version, ("variant", True, detail)]

    def _activate(self) -> None:
        """Set the variant and the number of threads, which are global to the process."""
        import drjit as dr
        import mitsuba as mi

        assert self._choice is not None
        mi.set_variant(self._choice.variant)
        mi.set_log_level(mi.LogLevel.Error)  # its warnings are about rounded sample counts
        dr.set_thread_count(self.options.threads or _own_threads())


def _own_threads() -> int:
    """The number of threads that the executor gives to this worker, else the number of cores."""
    share = os.environ.get("POSSE_THREADS", "")
    return int(share) if share.isdecimal() and int(share) else len(os.sched_getaffinity(0))
