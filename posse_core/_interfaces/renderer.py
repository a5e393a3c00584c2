"""Renderers: light from the spacecraft, and nothing else.

A renderer makes no labels, no stars, no Earth, no tone curve and no noise. It lives in a worker
process of its own, is opened once, renders frame after frame, and is closed.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence

from posse_core._model.scene import Radiance, RenderRequest, Scene
from posse_core._plugins.component import Component, OptionsT


class Renderer(Component[OptionsT]):
    """Turns a scene and a frame state into linear radiance.

    The Sun is a disc of ``sun_angular_radius_rad`` in ``sun_direction_cam`` that gives
    ``sun_irradiance_rgb_w_m2`` on a plate facing it. Both sides of a face are visible. The scene's
    camera is always a pinhole: where the user's lens distorts, the core asks for a finer image and
    distorts that.
    """

    @abstractmethod
    def open(self, scene: Scene) -> None:
        """Load the scene; called once, before the first frame.

        Raises:
            posse_core.ComponentError: this machine lacks what the renderer needs.
        """

    @abstractmethod
    def render(self, request: RenderRequest) -> Radiance:
        """Render one frame's box.

        Raises:
            posse_core.ComponentError: it failed; the frame is given up.
            posse_core.WorkerLost: a process that the renderer works in has died; the renderer
                is made anew and the frame tried again.
        """

    @abstractmethod
    def close(self) -> None:
        """Free what :meth:`open` took; may be called twice, or without open."""

    @classmethod
    def doctor(cls, options: OptionsT) -> Sequence[tuple[str, bool, str]]:
        """What the renderer needs of this machine: (what, whether it works, detail with the way out).

        ``posse doctor`` asks with the default options; nothing is opened.
        """
        return ()

    def describe(self) -> Mapping[str, str]:
        """Versions and choices for the manifest, such as ``{"mitsuba": "3.9.1"}``; after open."""
        return {}
