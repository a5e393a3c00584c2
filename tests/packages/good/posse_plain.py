"""A third party's distribution with a renderer, a propagator and an observer: the example of
docs/plugins.md."""

import numpy as np
from pydantic import Field

from posse_core import (
    ComponentSpec,
    Motion,
    Options,
    PropagationProblem,
    Propagator,
    Radiance,
    Renderer,
    RenderRequest,
    Scene,
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


class StillPropagator(Propagator):
    def propagate(self, problem: PropagationProblem) -> Motion:
        frames = len(problem.t_s)
        return Motion(
            t_s=problem.t_s,
            r_target_eci_m=np.tile([7.0e6, 0.0, 0.0], (frames, 1)),
            v_target_eci_m_s=np.tile([0.0, 7546.0, 0.0], (frames, 1)),
            r_chaser_rtn_m=np.tile([0.0, -20.0, 0.0], (frames, 1)),
            v_chaser_rtn_m_s=np.zeros((frames, 3)),
            sequence=np.zeros(frames, dtype=np.int64),
        )
