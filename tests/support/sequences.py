"""Looks at a frame that another one follows."""

from __future__ import annotations

from dataclasses import replace

from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.look import Look, Standpoint
from posse_core._model.craft_state import CraftState, Rates
from posse_core._model.mount import Mount
from posse_core._model.scene import FrameState, Onward, Scene

DURATION_S = 5.0


def look_at(scene: Scene, now: FrameState, then: FrameState | None, mount: Mount | None = None) -> Look:
    """The look at a frame of the chaser's camera, or of one beside it with the same lens.

    then: the next frame of the sequence, or None.
    """
    if then is not None:
        then = replace(then, index=now.index + 1, t_s=now.t_s + DURATION_S)
    onward = Onward(DURATION_S if then else 0.0, now.after, lambda: then)
    caster = RayCaster(scene)
    stand = Standpoint(replace(now, onward=onward), mount or Mount(), 0, "annotator")
    return Look(stand, scene, lambda camera: caster)


def posed(frame: FrameState, R_cam_from_body, t_body_cam_m, rates: Rates | None = None) -> FrameState:
    """A frame with another pose, and with other rates if they are given."""
    craft: CraftState = replace(
        frame.craft,
        R_cam_from_body=R_cam_from_body,
        t_body_cam_m=t_body_cam_m,
        rates=frame.craft.rates if rates is None else rates,
    )
    return replace(frame, craft=craft)
