"""The core's annotators. Each derives its labels from exact geometry; docs/labels.md explains every
key."""

from __future__ import annotations

from typing import Any

import numpy as np

from posse_core._annotators import rle
from posse_core._frames import quaternion_from_matrix
from posse_core._interfaces.annotator import Annotator
from posse_core._interfaces.look import Look
from posse_core._model.camera import Camera
from posse_core._model.craft_state import CraftState
from posse_core._model.labels import Labels, View
from posse_core._model.spacecraft import Spacecraft


class BoxAnnotator(Annotator):
    """``box_visible_px``, ``box_whole_px``."""

    def annotate(self, look: Look) -> Labels:
        view = look.view()
        whole = view.whole_box_px.tolist() if np.isfinite(view.whole_box_px).all() else None
        return Labels({"box_visible_px": visible_box(view), "box_whole_px": whole})


def visible_box(view: View) -> list[int] | None:
    """The tight box of the visible pixels: x, y, width, height; None where there are none."""
    columns = np.flatnonzero(view.mask.any(axis=0))
    rows = np.flatnonzero(view.mask.any(axis=1))
    if not len(columns):
        return None
    x, y = view.box.x0 + columns[0], view.box.y0 + rows[0]
    size = columns[-1] - columns[0] + 1, rows[-1] - rows[0] + 1
    return [int(number) for number in (x, y, *size)]


class MaskAnnotator(Annotator):
    """``mask_rle``, ``mask_area_px``, ``fraction_visible``, ``fraction_lit``."""

    def annotate(self, look: Look) -> Labels:
        view = look.view()
        area_px = int(view.mask.sum())
        return Labels(
            {
                "mask_rle": run_lengths(view, look.scene.camera),
                "mask_area_px": area_px,
                "fraction_visible": area_px / view.silhouette_px if view.silhouette_px else None,
                "fraction_lit": int((view.lit & view.mask).sum()) / area_px if area_px else None,
            }
        )


def run_lengths(view: View, camera: Camera) -> dict[str, Any]:
    """The mask of a view through a camera as the label ``mask_rle``."""
    size = camera.height_px, camera.width_px
    return {"size": list(size), "counts": rle.encode(view.mask, view.box, *size)}


class PartsAnnotator(Annotator):
    """``part_area_px``, the array ``part_id``, and, where there are several bodies, ``body_id``."""

    def annotate(self, look: Look) -> Labels:
        view = look.view()
        names = [part.name for part in look.scene.spacecraft.parts]
        area_px = np.bincount(view.part_id[view.mask], minlength=len(names)).tolist()
        arrays = {"part_id": view.part_id}
        if look.scene.others:
            bodies = np.append(look.scene.body_of_part, -1).astype(np.int16)
            arrays["body_id"] = bodies[view.part_id]
        return Labels({"part_area_px": dict(zip(names, area_px, strict=True))}, arrays)


class DepthAnnotator(Annotator):
    """The array ``depth_m``."""

    def annotate(self, look: Look) -> Labels:
        return Labels(arrays={"depth_m": look.view().depth_m})


class NormalsAnnotator(Annotator):
    """The array ``normal_cam``."""

    def annotate(self, look: Look) -> Labels:
        return Labels(arrays={"normal_cam": look.view().normal_cam})


class KeypointsAnnotator(Annotator):
    """``keypoints``: name → [u, v, visibility]."""

    def annotate(self, look: Look) -> Labels:
        return Labels({"keypoints": keypoint_labels(look.scene.spacecraft, look.view())})


def keypoint_labels(spacecraft: Spacecraft, view: View) -> dict[str, list[float | int | None]]:
    """Name → [u, v, visibility] of a spacecraft's keypoints in a view."""
    keypoints = {}
    for name, (u, v), visibility in zip(
        spacecraft.keypoints_body_m,
        view.keypoints_px.tolist(),
        view.keypoints_visibility.tolist(),
        strict=True,
    ):
        in_front = np.isfinite(u)
        keypoints[name] = [u if in_front else None, v if in_front else None, visibility]
    return keypoints


class PoseAnnotator(Annotator):
    """``q_cam_from_body``, ``t_body_cam_m``, ``range_m``, ``phase_angle_rad``,
    ``sun_direction_body``, the rates ``v_body_cam_m_s``, ``omega_body_rad_s``,
    ``omega_camera_rad_s``, where joints move ``joints``, and of a body that the chaser carries
    ``is_carried``."""

    def annotate(self, look: Look) -> Labels:
        frame = look.state
        sun, camera = frame.craft.sun_direction_cam, -frame.craft.t_body_cam_m
        more: dict[str, Any] = {}
        if frame.craft.articulation.joints:
            more["joints"] = _joints(frame.craft)
        if frame.craft.is_carried:
            more["is_carried"] = True
        # Near 0 and π the arc tangent keeps its precision, while the arc cosine loses half of its
        # digits.
        phase_rad = np.arctan2(np.linalg.norm(np.cross(sun, camera)), np.sum(sun * camera))
        return Labels(
            {
                "q_cam_from_body": quaternion_from_matrix(frame.craft.R_cam_from_body).tolist(),
                "t_body_cam_m": frame.craft.t_body_cam_m.tolist(),
                "range_m": frame.craft.range_m,
                "phase_angle_rad": float(phase_rad),
                "sun_direction_body": frame.craft.sun_direction_body.tolist(),
                "v_body_cam_m_s": frame.craft.rates.v_body_cam_m_s.tolist(),
                "omega_body_rad_s": frame.craft.rates.omega_body_rad_s.tolist(),
                "omega_camera_rad_s": frame.craft.rates.omega_camera_rad_s.tolist(),
                **more,
            }
        )


def _joints(craft: CraftState) -> dict[str, dict[str, Any]]:
    """The target's joints by name, as in :class:`posse_core.JointLabels`."""
    moving, poses = craft.articulation, craft.link_poses()
    return {
        joint.name: {
            "value": float(moving.values[k]),
            "rate": float(moving.rates[k]),
            "q_cam_from_link": quaternion_from_matrix(poses.R_cam_from_link[k + 1]).tolist(),
            "t_link_cam_m": poses.t_link_cam_m[k + 1].tolist(),
        }
        for k, joint in enumerate(moving.joints)
    }
