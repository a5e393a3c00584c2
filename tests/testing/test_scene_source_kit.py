"""The kit of scene sources catches what it is there for."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posse_core import ComponentError, Material, Options, SceneSource, Spacecraft
from posse_core.testing import SceneSourceConformance, scenes

FORMED = "test_the_spacecraft_is_well_formed"
METRES = "test_it_is_in_metres_about_its_centre_of_mass"
KEYPOINTS = "test_keypoints_are_on_the_spacecraft"
NORMALS = "test_normals_are_of_the_faces"
MATERIALS = "test_materials_are_in_their_ranges"
SYMMETRIES = "test_symmetries_leave_its_shape"
SAME = "test_the_same_options_give_the_same_spacecraft"

CAUGHT = {
    "nothing": {},
    "no such material": {FORMED: "there is no material"},
    "millimetres": {METRES: "in millimetres"},
    "origin of the file": {METRES: "the origin is the centre of mass"},
    "keypoints of the file": {KEYPOINTS: "'nose' at .* is off the spacecraft"},
    "long normals": {NORMALS: "has the length 2.000"},
    "inside out": {NORMALS: "are behind their faces"},
    "colours of 8 bits": {MATERIALS: "is the colour in 0 … 255"},
    "mirror": {SYMMETRIES: "a mirror image is another craft"},
    "wrong turn": {SYMMETRIES: "from the next one"},
    "unseeded": {SAME: "when it is built again"},
    "earlier build changed": {SAME: "when it is built again"},
    "of its process": {SAME: "when it is built in another process"},
}


class SpoiledOptions(Options):
    wrong: str = "nothing"


class Spoiled(SceneSource[SpoiledOptions]):
    """A ball with a plate, with one thing wrong."""

    scale = 1.0

    def build(self) -> Spacecraft:
        wrong = self.options.wrong
        ball = scenes.sphere("ball", "paint", rings=8)
        plate = scenes.rectangle("plate", "foil" if wrong == "no such material" else "paint")
        parts: Any = [ball, plate]
        if wrong == "millimetres":
            parts = [replace(part, vertices_body_m=1e3 * part.vertices_body_m) for part in parts]
        if wrong == "origin of the file":
            parts = [replace(part, vertices_body_m=part.vertices_body_m + 9.0) for part in parts]
        if wrong == "long normals":
            parts[0] = replace(ball, normals_body=2 * ball.normals_body)
        if wrong == "inside out":
            parts[0] = replace(ball, faces=ball.faces[:, ::-1])
        if wrong == "unseeded":
            noise = np.random.default_rng().normal(0, 1e-3, ball.vertices_body_m.shape)
            parts[0] = replace(ball, vertices_body_m=ball.vertices_body_m + noise)
        if wrong == "earlier build changed":
            self.scale *= 1.01
            parts[0] = replace(ball, uv=(self.scale * ball.uv).astype(np.float32))
        if wrong == "of its process":
            parts[1] = replace(plate, name=f"plate_{os.getpid()}")
        turn = np.diag([-1.0, 1.0, 1.0] if wrong == "mirror" else [-1.0, -1.0, 1.0])
        if wrong == "wrong turn":
            turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
        colour = (200.0, 100.0, 50.0) if wrong == "colours of 8 bits" else (0.8, 0.4, 0.2)
        nose = np.array([0.0, 0.0, 1e3 if wrong == "keypoints of the file" else 1.0])
        paint = {"paint": Material("paint", base_color=colour)}
        return Spacecraft("ball", tuple(parts), paint, {"nose": nose}, symmetries=(turn,))


@pytest.mark.parametrize("wrong", CAUGHT)
def test_a_wrong_scene_source_fails_for_its_own_reason(wrong: str) -> None:
    class Case(SceneSourceConformance):
        def source(self) -> SceneSource:
            return Spoiled(SpoiledOptions(wrong=wrong))

    for test in (name for name in vars(SceneSourceConformance) if name.startswith("test_")):
        reason = CAUGHT[wrong].get(test)
        if reason is not None:
            with pytest.raises((AssertionError, ComponentError), match=reason):
                getattr(Case(), test)()
        elif not CAUGHT[wrong]:
            getattr(Case(), test)()
