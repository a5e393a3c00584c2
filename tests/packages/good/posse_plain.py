"""A third party's distribution with a renderer, a propagator and an observer: the example of
docs/plugins.md."""

import numpy as np
from pydantic import Field

from posse_core import (
    ComponentSpec,
    Flight,
    FlightPropagator,
    Options,
    PropagationProblem,
    Radiance,
    Renderer,
    RenderRequest,
    Scene,
    Start,
    hookimpl,
)


@hookimpl
def posse_renderers():
    return [
        ComponentSpec(
            "plain",
            "even light over the whole box",
            "posse_plain:PlainRenderer",
            "posse_plain:PlainOptions",
            capabilities=frozenset({"deterministic"}),
        )
    ]


@hookimpl
def posse_propagators():
    return [ComponentSpec("still", "a chaser that stays", "posse_plain:StillPropagator")]


@hookimpl
def posse_frame_completed(index, labels):
    print(f"frame {index} of {labels.spacecraft}")


class PlainOptions(Options):
    level: float = Field(1.0, gt=0, description="radiance, W m⁻² sr⁻¹")


class PlainRenderer(Renderer):
    def open(self, scene: Scene) -> None:
        pass

    def render(self, request: RenderRequest) -> Radiance:
        shape = (request.box.height, request.box.width)
        light = np.full((*shape, 3), self.options.level, dtype=np.float32)
        return Radiance(request.box, light, np.ones(shape, dtype=np.float32))

    def close(self) -> None:
        pass


class StillPropagator(FlightPropagator):
    """The target by Kepler's laws, and a chaser that stays where it starts in RTN axes."""

    def fly(self, problem: PropagationProblem, start: Start, after_s: np.ndarray) -> Flight:
        stays = np.concatenate([start.rtn[:3], np.zeros(3)])
        return Flight(*start.target.two_body(after_s), np.tile(stays, (len(after_s), 1)))
