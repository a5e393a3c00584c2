"""Where the links of a scene are in one frame: in depth, and as the Sun sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posse_core import CraftState, FloatArray, LinkPoses, R_with_z
from posse_render_raster.craft import Link

SPHERE_RADII = 1.01
"""Radius of a link's sphere for clipping, in radii of the link; the margin is for rounding."""
NEAR_PLANE_RADII = 1e-3
"""Depth of the near plane if the camera is inside that sphere, in radii of the sphere."""


@dataclass(frozen=True)
class Layer:
    """Links that are in front of or behind all others, and have a depth buffer of their own, because its
    precision is that of its nearest link.

    Attributes:
        links: those that may be in view.
        clip_m: (near, far) planar depth.
    """

    links: Sequence[Link]
    clip_m: tuple[float, float]


def layers(links: Sequence[Link], poses: LinkPoses) -> list[Layer]:
    """The links in layers, the farthest first. Links that are behind the camera are left out."""
    spans: list[Layer] = []
    for link in links:
        t_m, radius_m = poses.t_link_cam_m[link.number], SPHERE_RADII * link.radius_m
        if t_m[2] + radius_m > 0:
            near_m = max(float(t_m[2]) - radius_m, NEAR_PLANE_RADII * radius_m)
            spans.append(Layer([link], (near_m, float(np.linalg.norm(t_m)) + radius_m)))
    spans.sort(key=lambda span: span.clip_m[0])
    out: list[Layer] = []
    for span in spans:
        if out and span.clip_m[0] <= out[-1].clip_m[1]:
            last = out.pop()
            far_m = max(last.clip_m[1], span.clip_m[1])
            span = Layer([*last.links, *span.links], (last.clip_m[0], far_m))
        out.append(span)
    return out[::-1]


@dataclass(frozen=True)
class Shade:
    """The shadow map of one body.

    Attributes:
        shadow_from_cam: (4, 4) from camera axes, m, to the map's coordinates: −1 … 1, as seen from the
            Sun, tight around the body; z grows away from the Sun.
        casters: the links that may shade the body, each with the (4, 4) matrix from its axes.
        widest_m: side of the map.
        nearest_m: planar depth of the body's spheres where they are nearest to the camera.
    """

    shadow_from_cam: FloatArray
    casters: Sequence[tuple[Link, FloatArray]]
    widest_m: float
    nearest_m: float


def shades(links: Sequence[Link], craft: CraftState, poses: LinkPoses) -> list[Shade]:
    """The shadow maps of the bodies, in their order."""
    axes = (R_with_z(craft.sun_direction_body) * [1.0, 1.0, -1.0]).T
    R_cam_from_world, t_world_cam_m, R_world_from_link, t_link_world_m = craft.world_poses()
    world_from_cam = np.linalg.inv(_homogeneous(R_cam_from_world, t_world_cam_m))
    from_link = [_homogeneous(R_world_from_link[e.number], t_link_world_m[e.number]) for e in links]
    along = [
        (axes @ R_world_from_link[each.number]) @ each.vertices_m
        + (axes @ t_link_world_m[each.number])[:, None]
        for each in links
    ]
    low, high = (np.array([ends(x, axis=1) for x in along]) for ends in (np.min, np.max))
    out = []
    for body in range(max(each.body for each in links) + 1):
        own = np.array([each.body == body for each in links])
        least, most = low[own].min(axis=0), high[own].max(axis=0)
        radius_m = max(each.radius_m for each in links if each.body == body)
        # The margin keeps the border texels empty, so that there is no shadow outside the map.
        half_m = np.maximum((most - least) / 2, 1e-6) * SPHERE_RADII + 1e-3 * radius_m
        shadow_from_world = np.eye(4)
        shadow_from_world[:3, :3] = axes / half_m[:, None]
        shadow_from_world[:3, 3] = -(least + most) / 2 / half_m
        beside = (high[:, :2] >= least[:2]) & (low[:, :2] <= most[:2])
        casts = beside.all(axis=1) & (low[:, 2] <= most[2])
        out.append(
            Shade(
                shadow_from_cam=shadow_from_world @ world_from_cam,
                casters=[
                    (links[k], shadow_from_world @ from_link[k]) for k in np.flatnonzero(casts).tolist()
                ],
                widest_m=float(2 / np.linalg.norm(shadow_from_world[:2, :3], axis=1).min()),
                nearest_m=min(
                    float(poses.t_link_cam_m[each.number, 2]) - each.radius_m
                    for each in links
                    if each.body == body
                ),
            )
        )
    return out


def _homogeneous(R: FloatArray, t_m: FloatArray) -> FloatArray:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = R, t_m
    return out
