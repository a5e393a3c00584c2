"""What spacecraft look like that a detector finds: boxes of their meshes, and refined poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from posse_core._annotators.exact import visible_box
from posse_core._arrays import AnyArray, FloatArray
from posse_core._evaluation.metrics import box_iou
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.detector import Detection, PoseEstimate
from posse_core._interfaces.refiner import Refinement, Refiner
from posse_core._model.camera import Camera
from posse_core._model.craft_state import CraftState
from posse_core._model.hull import hull_points
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Spacecraft

_LEAST_OVERLAP = 0.6
"""The mesh's box takes the place of the net's if they overlap by more: intersection over union."""
_CERTAIN = 0.5
"""So it does where they overlap at all, if the pose was refined and is certain by so much."""
_TOUCHING = 1e-3
"""A camera touches a mesh that is so near, as a share of the mesh's size."""

RefinerOf = Callable[[Spacecraft, Camera], Refiner]
"""Opens a refiner of a spacecraft in the images of a camera."""


@dataclass(frozen=True)
class Sighting:
    """A spacecraft as it was found in an image.

    Attributes:
        detection: with the box of the mesh at the pose, where the pose is trusted, else the net's.
        pose: refined if that succeeded; None if no pose fits the keypoints.
        refinement: what the refiner made of the pose; None without a refiner.
        start: the pose from the keypoints.
    """

    detection: Detection
    pose: PoseEstimate | None
    refinement: Refinement | None = None
    start: PoseEstimate | None = None


class Shapes:
    """The spacecraft of a detector's classes.

    Joints stay where they are at zero.
    """

    def __init__(self, crafts: Mapping[str, Spacecraft], refiner: RefinerOf | None = None) -> None:
        self._crafts = {name: craft.welded(()) for name, craft in crafts.items()}
        self._refiner = refiner
        self._casters: dict[str, RayCaster] = {}
        self._hulls_m: dict[str, FloatArray] = {}
        self._refiners: dict[str, tuple[Camera, Refiner]] = {}

    def seen(
        self,
        image: AnyArray,
        detection: Detection,
        poses: Sequence[PoseEstimate],
        camera: Camera,
        sun_direction_cam: FloatArray | None = None,
        box_px: FloatArray | None = None,
    ) -> Sighting:
        """Refine the pose of a detection, if there is a refiner, and take the mesh's box.

        The box is taken where it overlaps the net's by more than 0.6, or at all where the refinement
        was accepted and is certain.

        Args:
            poses: that the detection's keypoints may agree on, most trusted first; the refiner chooses.
            sun_direction_cam, box_px: as of :meth:`posse_core.Refiner.refine`.
        """
        if not poses or detection.label not in self._crafts:
            pose = next(iter(poses), None)
            return Sighting(detection, pose, start=pose)
        pose = start = poses[0]
        refinement = self.refined(image, detection.label, poses, camera, sun_direction_cam, box_px)
        if refinement is not None:
            if refinement.is_better:
                pose = refinement.pose
            else:
                pose = replace(start, certainty=refinement.certainty_left * start.certainty)
        mesh_px = self.box_px(detection.label, pose, camera)
        is_sure = refinement is not None and refinement.is_better and pose.certainty >= _CERTAIN
        least = 0.0 if is_sure else _LEAST_OVERLAP
        if mesh_px is not None and float(box_iou(mesh_px, detection.box_px)) > least:
            detection = replace(detection, box_px=mesh_px)
        return Sighting(detection, replace(pose, detection=detection), refinement, start)

    def __contains__(self, label: object) -> bool:
        """Whether the mesh of a class is known."""
        return label in self._crafts

    def refined(
        self,
        image: AnyArray,
        label: str,
        poses: Sequence[PoseEstimate],
        camera: Camera,
        sun_direction_cam: FloatArray | None = None,
        box_px: FloatArray | None = None,
    ) -> Refinement | None:
        """What the refiner makes of the poses of a class; None without a refiner, or without the mesh.

        The arguments are as in :meth:`posse_core.Refiner.refine`.
        """
        if self._refiner is None or label not in self._crafts:
            return None
        opened = self._opened(self._refiner, label, camera)
        return opened.refine(image, poses, sun_direction_cam, box_px)

    def box_px(self, label: str, pose: PoseEstimate, camera: Camera) -> FloatArray | None:
        """The box (4,) x, y, width, height of the pixels that the mesh covers at a pose, as the label
        ``box_visible_px``; None where there is none, the mesh is not known, or the camera touches the
        mesh's bounds or is within them."""
        if label not in self._crafts or pose.t_body_cam_m[2] <= 0:
            return None
        # Wrong poses put the camera onto a side of the mesh, and rays that start on a triangle take a
        # thousand times as long as others.
        low_m, high_m = self._crafts[label].bounds_body_m
        camera_body_m = -pose.R_cam_from_body.T @ pose.t_body_cam_m
        room_m = _TOUCHING * (high_m - low_m).max()
        if np.all((camera_body_m > low_m - room_m) & (camera_body_m < high_m + room_m)):
            return None
        if label not in self._casters:
            self._casters[label] = RayCaster(Scene(self._crafts[label], camera))
        state = CraftState.unlit(pose.R_cam_from_body, pose.t_body_cam_m)
        box = visible_box(self._casters[label].through(camera).view(state))
        return None if box is None else np.array(box, np.float64)

    def extent_px(self, label: str, pose: PoseEstimate, camera: Camera) -> FloatArray | None:
        """The box (4,) of the image's pixels between the mesh's outermost vertices, found in a hundredth
        of the time that :meth:`box_px` takes.

        It is larger than that by thin ends that cover no pixel's centre, and where the mesh is partly
        outside the image, and smaller by what a lens curves outwards between vertices. None where the
        mesh is not known, behind the camera or beside the image, and where the camera is within it.
        """
        if label not in self._crafts or pose.t_body_cam_m[2] <= 0:
            return None
        if label not in self._hulls_m:
            vertices = [part.vertices_body_m for part in self._crafts[label].parts]
            self._hulls_m[label] = hull_points(np.concatenate(vertices))
        px = camera.project(self._hulls_m[label] @ pose.R_cam_from_body.T + pose.t_body_cam_m)
        if np.isnan(px).any():
            # A part is behind the camera, or beyond the reach of its lens.
            return self.box_px(label, pose, camera)
        first = np.maximum(np.ceil(px.min(axis=0)), 0)
        last = np.minimum(np.floor(px.max(axis=0)), [camera.width_px - 1, camera.height_px - 1])
        return np.concatenate([first, last - first + 1]) if np.all(last >= first) else None

    def close(self) -> None:
        """Close the refiners."""
        for _, refiner in self._refiners.values():
            refiner.close()
        self._refiners.clear()

    def _opened(self, opener: RefinerOf, label: str, camera: Camera) -> Refiner:
        """The refiner of a class, which is kept open while the camera is the same."""
        known = self._refiners.get(label)
        if known is not None and known[0] == camera:
            return known[1]
        if known is not None:
            known[1].close()
        refiner = opener(self._crafts[label], camera)
        self._refiners[label] = camera, refiner
        return refiner
