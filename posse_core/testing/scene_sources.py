"""The conformance class for scene sources."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from posse_core._arrays import AnyArray
from posse_core._interfaces.scene import SceneSource
from posse_core._model.spacecraft import Part, Spacecraft
from posse_core._simulator.returned import checked_spacecraft
from posse_core.testing.conformance import Conformance
from posse_core.testing.elsewhere import in_another_process

_SIZES_M = (0.01, 500.0)
"""Sides that a spacecraft may have, metres."""
_AGAINST_FACES = 0.2
"""Share of a part's corners whose shading normal may be behind the face."""
_SYMMETRIC = 0.02
"""How far a symmetry may move a vertex from the next one, as a share of the spacecraft's radius."""


class SceneSourceConformance(Conformance):
    """What every scene source must do. A subclass provides :meth:`source`."""

    @abstractmethod
    def source(self) -> SceneSource[Any]:
        """A new scene source, with the same options each time; its class must be importable."""

    def test_the_spacecraft_is_well_formed(self) -> None:
        """Arrays of the right shapes, whose indices and names exist."""
        self._built()

    def test_it_is_in_metres_about_its_centre_of_mass(self) -> None:
        craft = self._built()
        low, high = craft.bounds_body_m
        size_m = float((high - low).max())
        assert _SIZES_M[0] <= size_m <= _SIZES_M[1], (
            f"its longest side is {size_m:g} m; are the vertices in millimetres or in units of a file?"
        )
        outside = (low > 0.5 * size_m).any() or (high < -0.5 * size_m).any()
        assert not outside, (
            f"the origin is far outside of the spacecraft, which is within {low.round(3).tolist()} to"
            f" {high.round(3).tolist()} m; the origin is the centre of mass"
        )

    def test_keypoints_are_on_the_spacecraft(self) -> None:
        craft = self._built()
        low, high = craft.bounds_body_m
        slack_m = 0.05 * float((high - low).max())
        for name, point in craft.keypoints_body_m.items():
            if name in craft.keypoint_joints:
                continue  # where it is with every joint at zero may be inside what it will unfold from
            inside = (point >= low - slack_m).all() and (point <= high + slack_m).all()
            assert inside, (
                f"the keypoint {name!r} at {np.round(point, 3).tolist()} m is off the spacecraft, which"
                f" is within {low.round(3).tolist()} to {high.round(3).tolist()} m; are its axes, its"
                " unit or its origin those of the file?"
            )

    def test_normals_are_of_the_faces(self) -> None:
        """Shading normals have unit length, and are on the outer side of the faces."""
        for part in self._built().parts:
            length = np.linalg.norm(part.normals_body, axis=1)
            assert np.abs(length - 1).max() < 1e-3, (
                f"{part.name}: a shading normal has the length {length[np.abs(length - 1).argmax()]:.3f}"
            )
            faces = part.vertices_body_m[part.faces]
            outer = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
            against = (part.normals_body[part.faces] * outer[:, None]).sum(axis=-1) < 0
            assert against.mean() <= _AGAINST_FACES, (
                f"{part.name}: {against.mean():.0%} of the shading normals are behind their faces; the"
                " corners of a face are counter-clockwise seen from outside"
            )

    def test_materials_are_in_their_ranges(self) -> None:
        for name, material in self._built().materials.items():
            values = (*material.base_color, material.metallic, material.roughness, material.specular)
            assert all(0 <= value <= 1 for value in values), (
                f"{name}: base colour, metallic, roughness and specular are 0 … 1, not {values}; is the"
                " colour in 0 … 255?"
            )

    def test_symmetries_leave_its_shape(self) -> None:
        """Each is a rotation, and takes every vertex to a place where there is one."""
        craft = self._built()
        vertices_m = np.concatenate([part.vertices_body_m for part in craft.parts])
        tree = cKDTree(vertices_m)
        for R in craft.symmetries:
            rotation = np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0
            assert rotation, f"the symmetry {R.tolist()} is no rotation; a mirror image is another craft"
            away_m = float(np.max(tree.query(vertices_m @ R.T)[0]))
            assert away_m <= _SYMMETRIC * craft.radius_m, (
                f"the symmetry {np.round(R, 3).tolist()} moves a vertex {away_m:.3g} m from the next one"
            )

    def test_the_same_options_give_the_same_spacecraft(self) -> None:
        """To the bit: built again, and by a new source in another process."""
        source = self.source()
        first = list(_content(source.build()))
        for what, again in {
            "built again": source.build(),
            "built in another process": in_another_process(_build, type(source), source.options),
        }.items():
            for (name, one), (_, two) in zip(first, _content(again), strict=True):
                np.testing.assert_array_equal(
                    two,
                    one,
                    f"{name} is another one when it is {what}; does an unseeded draw, the order of a set"
                    " or something that an earlier build changed go into it?",
                )

    def _built(self) -> Spacecraft:
        """The spacecraft; one of many triangles takes seconds to build, so it is built once."""
        source = self.source()
        key = type(source), source.options.model_dump_json()
        if key not in _BUILT:
            _BUILT[key] = source.build()
        return checked_spacecraft(_BUILT[key], type(source).__name__)


_BUILT: dict[tuple[type, str], Spacecraft] = {}


def _build(kind: Any, options: Any) -> Spacecraft:
    made: Spacecraft = kind(options).build()
    return made


def _content(craft: Spacecraft) -> Iterator[tuple[str, AnyArray]]:
    """Everything of a spacecraft, as names and arrays."""
    yield "the name", np.array(craft.name)
    yield "the list of parts", np.array([part.name for part in craft.parts])
    for part in craft.parts:
        for name in (each for each in Part.__dataclass_fields__ if each != "name"):
            yield f"{name} of {part.name}", np.asarray(getattr(part, name), dtype=_dtype(part, name))
    for name, material in craft.materials.items():
        for key, value in vars(material).items():
            yield f"{key} of the material {name}", np.array(-1 if value is None else value)
    yield "the list of keypoints", np.array(list(craft.keypoints_body_m))
    yield "a keypoint", np.array(list(craft.keypoints_body_m.values()))
    yield "the joints", np.array([repr(joint) for joint in craft.joints])


def _dtype(part: Part, name: str) -> Any:
    return None if isinstance(getattr(part, name), np.ndarray) else str
