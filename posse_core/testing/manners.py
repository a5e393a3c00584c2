"""Conformance of renderers: opening, closing, independence of frames, determinism."""

from __future__ import annotations

import multiprocessing

import numpy as np
from pydantic import BaseModel

from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import PixelBox
from posse_core._model.scene import FrameState, Radiance, RenderRequest, Scene
from posse_core.testing import scenes
from posse_core.testing.stage import RendererStage, attitudes, ball, craft, facing


class MannersConformance(RendererStage):
    """A renderer can be closed at any time, keeps no state between frames, and is deterministic."""

    def test_close_may_be_called_at_any_time(self) -> None:
        renderer = self.renderer()
        renderer.close()
        renderer = self.renderer()
        renderer.open(ball())
        renderer.close()
        renderer.close()

    def test_a_frame_leaves_nothing_behind(self) -> None:
        """The third of three frames equals the same frame of a new renderer."""
        scene = craft()
        suns: list[tuple[float, float, float]] = [(1, 0, 1), (0, -1, 1), (-1, 1, 1)]
        frames = [
            scenes.frame(t_body_cam_m=(0.0, 0.0, z), sun_direction_body=sun, R_cam_from_body=R)
            for z, sun, R in zip((4.0, 9.0, 5.0), suns, attitudes(), strict=True)
        ]
        with self.opened(scene) as stage:
            after = [stage.shot(frame) for frame in frames][-1]
        with self.opened(scene) as stage:
            fresh = stage.shot(frames[-1])
        np.testing.assert_allclose(
            after.coverage,
            fresh.coverage,
            atol=0.25,
            err_msg="coverage depends on the frames before: is a transform or a buffer kept?",
        )
        np.testing.assert_allclose(
            after.radiance_rgb.sum(),
            fresh.radiance_rgb.sum(),
            rtol=0.02,
            err_msg=(
                "radiance depends on the frames before: is the Sun, a shadow map or a transform kept?"
            ),
        )

    def test_the_same_request_gives_the_same_bits(self) -> None:
        """Capability ``deterministic``: also in another process, started by spawn."""
        if "deterministic" not in self.capabilities:
            return
        scene, frame = ball(), facing(sun=(1.0, 0.0, 1.0))
        with self.opened(scene) as stage:
            one = stage.shot(frame)
            stage.shot(facing(sun=(0.0, 1.0, 1.0)), seed=5)
            two = stage.shot(frame)
        np.testing.assert_array_equal(
            one.radiance_rgb,
            two.radiance_rgb,
            err_msg=(
                "radiance differs between two times of one request; leave out 'deterministic', "
                "or seed what is drawn by request.seed"
            ),
        )
        np.testing.assert_array_equal(
            one.coverage,
            two.coverage,
            err_msg=(
                "coverage differs between two times of one request; leave out 'deterministic', "
                "or seed what is drawn by request.seed"
            ),
        )
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            three = pool.apply(_in_child, (type(stage.renderer), stage.renderer.options, scene, frame))
        np.testing.assert_array_equal(
            one.radiance_rgb,
            three.radiance_rgb,
            err_msg=(
                "radiance differs in another process; leave out 'deterministic', or make it "
                "free of threads, time and caches"
            ),
        )

    def test_it_says_what_it_is(self) -> None:
        with self.opened(ball()) as stage:
            description = stage.renderer.describe()
        assert description, "describe() is empty; give versions and choices for the manifest"
        assert all(
            isinstance(key, str) and isinstance(value, str) for key, value in description.items()
        ), "describe() must give strings by strings"


def _in_child(kind: type[Renderer], options: BaseModel, scene: Scene, frame: FrameState) -> Radiance:
    renderer = kind(options)
    renderer.open(scene)
    try:
        box = PixelBox(0, 0, scene.camera.width_px, scene.camera.height_px)
        return renderer.render(RenderRequest(frame.craft, box, None, 1))
    finally:
        renderer.close()
