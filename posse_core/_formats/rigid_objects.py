"""The rigid objects of a dataset, and what each frame shows of them, for formats that know no joints.

A spacecraft whose joints move is several objects: ``NAME``, what its body itself carries, and
``NAME-JOINT`` for each joint that carries a part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from posse_core._arrays import BoolArray, FloatArray, IntArray
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.mesh import Mesh
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._errors import InputError
from posse_core._frames import matrix_from_quaternion
from posse_core._geometry.raycast import RayCaster
from posse_core._model.craft_state import AT_REST, CraftState, Rates
from posse_core._model.joints import RIGID, Articulation
from posse_core._model.label_line import BodyLabels, Box, LabelLine
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft


@dataclass(frozen=True)
class RigidObject:
    """What moves as one.

    Attributes:
        id: number, from 1.
        name: of the object.
        joint: that carries it; None if the body itself does.
        parts: (P,) indices of its parts among those of its spacecraft.
        mesh: its triangles, in body axes with every joint at zero.
        symmetries: rotations (3, 3) that leave its appearance unchanged, without the identity.
    """

    id: int
    name: str
    joint: str | None
    parts: IntArray
    mesh: Mesh
    symmetries: tuple[FloatArray, ...]

    @property
    def radius_m(self) -> float:
        """Largest distance of a vertex from the origin."""
        return float(np.sqrt((self.mesh.vertices_body_m**2).sum(axis=1).max()))


@dataclass(frozen=True)
class Silhouette:
    """What an object would cover without the others, and without its own body's other objects.

    Attributes:
        mask: (H, W) bool, in the image.
        count_px: number of pixels, also beyond the image.
        box_px: around the projected vertices, as ``box_whole_px``; None if one is behind the camera.
    """

    mask: BoolArray
    count_px: int
    box_px: Box | None


@dataclass(frozen=True)
class ObjectInView:
    """An object in one frame.

    Attributes:
        object: which it is.
        q_cam_from_object, t_object_cam_m: its pose.
        mask: (H, W) bool, where the image shows it.
        box_px: of the mask, as ``box_visible_px``.
        area_px: of the mask.
        silhouette: casts what it would cover by itself, which takes longer than all else.
    """

    object: RigidObject
    q_cam_from_object: tuple[float, float, float, float]
    t_object_cam_m: tuple[float, float, float]
    mask: BoolArray
    box_px: Box | None
    area_px: int
    silhouette: Callable[[], Silhouette]


class RigidObjects:
    """The rigid objects of a dataset: of each target's spacecraft by name, then of each body's.

    Bodies that are alike, with the same joints, share their objects.

    Attributes:
        objects: in the order of their ids.
    """

    def __init__(self, dataset: Dataset) -> None:
        """Find the objects.

        Raises:
            InputError: a spacecraft's file is missing or damaged.
        """
        self._dataset = dataset
        self.objects: list[RigidObject] = []
        known: dict[tuple[str, tuple[str | None, ...], bytes], list[_Link]] = {}

        def links(info: SpacecraftInfo, mesh: Mesh) -> list[_Link]:
            carriers = tuple(info.part_joints.get(part) for part in info.parts)
            key = info.name, carriers, mesh.vertices_body_m.tobytes()
            if key not in known:
                known[key] = self._links(info, mesh, carriers)
            return known[key]

        crafts = sorted(dataset.spacecraft_by_name.items())
        self._of_craft = {name: links(info, dataset.mesh(name)) for name, info in crafts}
        bodies = dataset.bodies.items()
        self._of_body = {name: links(info, dataset.body_mesh(name)) for name, info in bodies}

    def _links(self, info: SpacecraftInfo, mesh: Mesh, carriers: tuple[str | None, ...]) -> list[_Link]:
        links = []
        for joint in (None, *(joint.name for joint in info.joints)):
            parts = np.flatnonzero([carrier == joint for carrier in carriers])
            if not len(parts):
                continue
            made = RigidObject(
                id=len(self.objects) + 1,
                name=info.name if joint is None else f"{info.name}-{joint}",
                joint=joint,
                parts=parts,
                mesh=_only(mesh, parts),
                symmetries=() if info.joints else info.symmetries,
            )
            self.objects.append(made)
            links.append(_Link(made, info, self._dataset))
        return links

    def in_frame(self, labels: LabelLine) -> Iterator[ObjectInView]:
        """The objects of a frame: those of the target, then those of each body, as its line names them.

        Raises:
            InputError: part ids are needed to tell a spacecraft's objects apart, and there are none.
        """
        first_part = 0
        alone = not labels.has("bodies") and not labels.has("joints")
        for name, body in labels.instances.items():
            links = self._of_craft[body.spacecraft] if name is None else self._of_body[name]
            if len(links) == 1:
                mask = body.mask_rle.mask()
                yield ObjectInView(
                    links[0].object,
                    *links[0].pose(body),
                    mask,
                    body.box_visible_px,
                    body.mask_area_px,
                    partial(_of_labels, body, mask) if alone else partial(links[0].silhouette, body),
                )
            else:
                part_id = self._part_id(labels)
                for link in links:
                    mask = np.isin(part_id, first_part + link.object.parts)
                    yield ObjectInView(
                        link.object,
                        *link.pose(body),
                        mask,
                        _box_of(mask),
                        int(mask.sum()),
                        partial(link.silhouette, body),
                    )
            first_part += len(links[0].info.parts)

    def _part_id(self, labels: LabelLine) -> IntArray:
        arrays = self._dataset.truth(self._dataset.position(labels.index))
        if "part_id" not in arrays:
            raise InputError(
                f"{self._dataset.folder}: frame {labels.index} has no part ids, by which a spacecraft's"
                " moving parts are told apart; add 'parts' to the scenario's annotators"
            )
        return arrays["part_id"]


class _Link:
    """An object of one spacecraft, which rays are cast onto."""

    def __init__(self, object_: RigidObject, info: SpacecraftInfo, dataset: Dataset) -> None:
        self.object, self.info = object_, info
        self._camera = dataset.camera
        self._caster: RayCaster | None = None

    def pose(
        self, body: BodyLabels
    ) -> tuple[tuple[float, float, float, float], tuple[float, float, float]]:
        """Attitude and position of the object, by the labels of its body."""
        if self.object.joint is None:
            return body.q_cam_from_body, body.t_body_cam_m
        moved = body.joints[self.object.joint]
        return moved.q_cam_from_link, moved.t_link_cam_m

    def silhouette(self, body: BodyLabels) -> Silhouette:
        """What the object covers by itself, each row of the image at its own time."""
        if self._caster is None:
            self._caster = RayCaster(Scene(_spacecraft(self.object, self.info), self._camera))
        view = self._caster.view(_state(body, self.info))
        mask = np.zeros((self._camera.height_px, self._camera.width_px), dtype=bool)
        mask[view.box.slices] = view.mask
        box = Box(*view.whole_box_px.tolist()) if np.isfinite(view.whole_box_px).all() else None
        return Silhouette(mask, view.silhouette_px, box)


def _of_labels(body: BodyLabels, mask: BoolArray) -> Silhouette:
    """The silhouette of a rigid spacecraft that is alone in its scene: nothing hides it."""
    share = body.fraction_visible
    return Silhouette(mask, round(body.mask_area_px / share) if share else 0, body.box_whole_px)


def _box_of(mask: BoolArray) -> Box | None:
    columns, rows = (np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1))
    if not len(columns):
        return None
    x, y = int(columns[0]), int(rows[0])
    return Box(x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1)


def _only(mesh: Mesh, parts: IntArray) -> Mesh:
    """The triangles of some parts, with their vertices alone."""
    mine = np.isin(mesh.part_id, parts)
    if mine.all():
        return mesh
    used, faces = np.unique(mesh.faces[mine], return_inverse=True)
    return Mesh(
        vertices_body_m=mesh.vertices_body_m[used],
        faces=faces.reshape(-1, 3).astype(np.int32),
        part_id=mesh.part_id[mine],
    )


def _spacecraft(object_: RigidObject, info: SpacecraftInfo) -> Spacecraft:
    mesh = object_.mesh
    part = Part(
        name=object_.name,
        vertices_body_m=mesh.vertices_body_m,
        faces=mesh.faces,
        normals_body=np.zeros(mesh.vertices_body_m.shape, dtype=np.float32),
        uv=np.zeros((len(mesh.vertices_body_m), 2), dtype=np.float32),
        material="any",
        joint=object_.joint,
    )
    return Spacecraft(object_.name, (part,), {"any": Material("any")}, joints=info.joints)


def _state(body: BodyLabels, info: SpacecraftInfo) -> CraftState:
    """The labelled state, in no light."""
    rates = AT_REST
    if body.has("v_body_cam_m_s", "omega_body_rad_s", "omega_camera_rad_s"):
        rates = Rates(
            np.array(body.v_body_cam_m_s),
            np.array(body.omega_body_rad_s),
            np.array(body.omega_camera_rad_s),
        )
    moving = [body.joints[joint.name] for joint in info.joints]
    articulation = RIGID
    if moving:
        values, rates_of_joints = (
            np.array([getattr(each, key) for each in moving]) for key in ("value", "rate")
        )
        articulation = Articulation(info.joints, values, rates_of_joints)
    return CraftState.unlit(
        matrix_from_quaternion(np.array(body.q_cam_from_body)),
        np.array(body.t_body_cam_m),
        rates=rates,
        articulation=articulation,
        is_carried=body.has("is_carried") and body.is_carried,
    )
