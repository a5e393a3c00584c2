"""Conformance of renderers: light from the sky."""

from __future__ import annotations

import numpy as np

from posse_core._model.scene import EnvironmentMap
from posse_core.testing import scenes
from posse_core.testing.closed_forms import directions
from posse_core.testing.stage import SIDES, RendererStage, attitudes, ball, centroid, facing


class SkyConformance(RendererStage):
    """Capability ``environment``: radiance, direction, and independence of frames."""

    def test_an_even_sky_lights_a_white_ball_evenly(self) -> None:
        """Capability ``environment``: the furnace test, in which a white ball has the radiance of the
        sky."""
        if "environment" not in self.capabilities:
            return
        level = np.array([2.0, 1.0, 0.5])
        sky = EnvironmentMap(np.full((16, 32, 3), level, dtype=np.float32))
        with self.opened(ball()) as stage:
            frame = facing(sun=(0.0, 0.0, 1.0), sun_fraction=0.0)
            image = stage.shot(frame, environment=sky)
        full = image.coverage > 0.999
        mean = image.radiance_rgb[full].mean(axis=0)
        np.testing.assert_allclose(
            mean,
            level,
            rtol=2 * self.radiance_tolerance,
            err_msg=(
                "a white ball in an even sky has another radiance than the sky: is the map "
                "integrated with cos θ/π?"
            ),
        )
        assert image.radiance_rgb[image.coverage == 0].max() == 0.0, "the sky itself is in the image"
        assert image.coverage.min() == 0.0, "every pixel is covered: the sky is not part of the coverage"

    def test_the_skys_bright_side_lights_that_side(self) -> None:
        """Capability ``environment``: the map is in camera axes, whatever the spacecraft's attitude."""
        if "environment" not in self.capabilities:
            return
        around = directions(16)
        with self.opened(ball()) as stage:
            R = attitudes()[0]
            for side, axis in {**SIDES, "behind the camera": (0.0, 0.0, -1.0)}.items():
                bright = np.maximum(around @ axis, 0.0) ** 4
                sky = EnvironmentMap(np.stack([bright] * 3, axis=-1).astype(np.float32))
                frame = scenes.frame(
                    t_body_cam_m=(0.0, 0.0, 4.0),
                    sun_direction_body=(0, 0, 1),
                    R_cam_from_body=R,
                    sun_fraction=0.0,
                )
                image = stage.shot(frame, environment=sky)
                light = image.radiance_rgb.sum(axis=-1)
                offset = centroid(light) - centroid(image.coverage)
                if axis[2]:
                    assert np.abs(offset).max() < 0.5, (
                        "a sky that is bright behind the camera lights the ball off its middle: are the "
                        "map's axes the camera's?"
                    )
                    assert light.max() > 0.8, (
                        "a sky that is bright behind the camera hardly lights the ball's front"
                    )  # 3 bands of 1/3
                else:
                    assert offset @ axis[:2] > 1.0, f"the sky is bright {side}, the ball is not"
                    assert abs(offset @ [axis[1], axis[0]]) < 0.5, (
                        "the light is off to a side where the sky is not bright: are the map's axes the "
                        "camera's, and its seam behind?"
                    )

    def test_a_sky_comes_and_goes(self) -> None:
        """A frame's sky does not affect later frames without a sky or with a dark one."""
        if "environment" not in self.capabilities:
            return
        dark = facing(sun=(0.0, 0.0, 1.0), sun_fraction=0.0)
        with self.opened(ball()) as stage:
            for level in (1.0, None, 3.0, 0.0, 2.0):
                sky = None
                if level is not None:
                    sky = EnvironmentMap(np.full((8, 16, 3), level, dtype=np.float32))
                image = stage.shot(dark, environment=sky)
                mean = image.radiance_rgb[image.coverage > 0.999].mean()
                np.testing.assert_allclose(
                    mean,
                    level or 0.0,
                    rtol=0.05,
                    err_msg=(
                        "a frame's light is that of another frame's sky: is the map kept when the next "
                        "frame has another, or none?"
                    ),
                )
