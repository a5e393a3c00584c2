"""The points that a frame shows, and where they are in the next one: several annotators ask for them.

Those of the last look are kept.
"""

from __future__ import annotations

from functools import lru_cache

from posse_core._arrays import FloatArray
from posse_core._geometry.rows import points_seen_by_rows, surface_points
from posse_core._interfaces.look import Look


@lru_cache(maxsize=1)
def shown(look: Look) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions in the image, in camera axes and in those of each point's link, as by
    :func:`surface_points`."""
    return surface_points(look.state.craft, look.scene, look.view())


@lru_cache(maxsize=1)
def shown_next(look: Look) -> tuple[Look, FloatArray, FloatArray] | None:
    """The look at the sequence's next frame; (N, 3) where the points are when its rows see them, in its
    camera axes; and (N,) seconds after its instant. None where there is no next frame."""
    following = look.next_frame
    if following is None:
        return None
    view = look.view()
    _, _, x_link_m = shown(look)
    return following, *points_seen_by_rows(
        following.state.craft, look.scene, x_link_m, view.part_id[view.hit]
    )
