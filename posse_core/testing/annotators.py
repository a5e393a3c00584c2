"""The conformance class for annotators."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._frames import matrix_from_rotation_vector
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.annotator import Annotator
from posse_core._interfaces.look import Look, Standpoint
from posse_core._model.craft_state import BodyState
from posse_core._model.labels import Labels
from posse_core._model.mount import Mount
from posse_core._model.scene import Body, FrameState, Onward, Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._simulator.returned import checked_labels
from posse_core.testing import scenes
from posse_core.testing.conformance import Conformance
from posse_core.testing.elsewhere import in_another_process
from posse_core.testing.stage import craft

SEED = 7
_KEYPOINTS = {"tip": np.array([2.0, 0.3, 0.0]), "top": np.array([0.0, 1.5, 0.6]), "nose": np.eye(3)[2]}
_PLACES = {
    "in view": (0.0, 0.0, 6.0),
    "cut by the border": (2.2, -0.3, 6.0),
    "far away": (0.5, -0.3, 900.0),
    "beside the image": (9.0, 0.0, 8.0),
    "behind the camera": (0.0, 0.0, -9.0),
}


class AnnotatorConformance(Conformance):
    """What every annotator must do. A subclass provides :meth:`annotator`.

    The kit's spacecraft is a drum with a wing and a boom, 2.6 m wide, with three keypoints; another
    drum flies beside it. The camera has 192 by 144 pixels, and sees it near, cut by the border, as a
    point, and not at all; most frames have a next one, the last has none.
    """

    @abstractmethod
    def annotator(self) -> Annotator[Any]:
        """A new annotator, with the same options each time; its class must be importable."""

    def test_its_labels_can_be_written(self) -> None:
        """Plain JSON types and finite numbers; arrays over the view's box."""
        annotator = self.annotator()
        for where, look in _looks().items():
            labels = self._labels(annotator, look)
            try:
                json.dumps(dict(labels.values), allow_nan=False)
            except (TypeError, ValueError) as error:
                raise AssertionError(f"{where}: the labels cannot be written as JSON: {error}") from None

    def test_every_frame_has_the_same_labels_and_arrays(self) -> None:
        """Also where the spacecraft is out of view: a label without a value is None, an array is empty
        or holds NaN, −1 or False."""
        annotator = self.annotator()
        kinds = {where: _kind(self._labels(annotator, look)) for where, look in _looks().items()}
        first = kinds["in view"]
        for where, kind in kinds.items():
            assert kind == first, (
                f"a frame {where} has the labels and arrays {kind}, and one in view has {first}; is a"
                " label left out, or an array of another type, where there is nothing to see?"
            )

    def test_it_makes_something(self) -> None:
        labels = self._labels(self.annotator(), _looks()["in view"])
        assert labels.values or labels.arrays, "it gives neither labels nor arrays of a frame in view"

    def test_a_frame_does_not_depend_on_others(self) -> None:
        """To the bit: in another order, and from a new annotator."""
        annotator, looks = self.annotator(), _looks()
        before = {where: self._labels(annotator, look) for where, look in looks.items()}
        for where, look in reversed(list(_looks().items())):
            _assert_equal(
                self._labels(annotator, look),
                before[where],
                f"a frame {where}, annotated again in another order, has other labels; does the"
                " annotator keep something of the last frame, or draw from a generator of its own?"
                " Draws are those of look.generator(purpose)",
            )
            _assert_equal(
                self._labels(self.annotator(), look),
                before[where],
                f"a frame {where} has other labels from a new annotator; does the class keep a state?",
            )

    def test_a_worker_gives_the_same_labels(self) -> None:
        """To the bit, in another process, as in the workers of a run."""
        annotator = self.annotator()
        elsewhere = in_another_process(_all_labels, type(annotator), annotator.options)
        for where, labels in _all_labels(type(annotator), annotator.options).items():
            _assert_equal(
                elsewhere[where],
                labels,
                f"a frame {where} has other labels in another process; does the order of a set, an"
                " identity, the time or an unseeded draw go into them?",
            )

    def test_another_camera_and_another_body(self) -> None:
        """A look of a sensor is through a camera of its own, and one may be about another body."""
        annotator = self.annotator()
        kind = _kind(self._labels(annotator, _looks()["in view"]))
        wide = replace(_scene(), camera=scenes.camera(64, 48, 1.2))
        for what, look in {
            "through another camera": _look(_states()["in view"], wide),
            "about the body beside the target": _looks()["in view"].about(1),
        }.items():
            found = _kind(self._labels(annotator, look))
            assert found == kind, (
                f"a look {what} gives {found}, and the chaser's camera at the target {kind}; does the"
                " annotator keep the camera or the scene of the first look?"
            )

    def test_a_spacecraft_without_keypoints(self) -> None:
        """Not every spacecraft has keypoints."""
        plain = replace(_scene(), spacecraft=replace(_craft(), keypoints_body_m={}))
        self._labels(self.annotator(), _look(_states()["in view"], plain))

    def test_what_it_is_given_is_left_alone(self) -> None:
        look = _looks()["in view"]
        kept = [np.array(x) for x in _arrays(look)]
        self._labels(self.annotator(), look)
        for now, before in zip(_arrays(look), kept, strict=True):
            np.testing.assert_array_equal(
                now, before, "it changed an array of its look, which other annotators get too; copy it"
            )

    def _labels(self, annotator: Annotator[Any], look: Look) -> Labels:
        return checked_labels(annotator.annotate(look), type(annotator).__name__, look.view())


def _all_labels(kind: Callable[[Any], Annotator[Any]], options: Any) -> Mapping[str, Labels]:
    annotator = kind(options)
    return {where: annotator.annotate(look) for where, look in _looks().items()}


def _craft() -> Spacecraft:
    return replace(craft().spacecraft, keypoints_body_m=_KEYPOINTS)


def _scene() -> Scene:
    drum = scenes.sphere("drum", "white", radius_m=0.4, rings=16)
    beside = replace(craft().spacecraft, name="other", parts=(drum,))
    return Scene(_craft(), craft().camera, (Body("other", beside),))


def _states() -> Mapping[str, FrameState]:
    states: dict[str, FrameState] = {}
    for index, (where, place) in enumerate(_PLACES.items()):
        turned = matrix_from_rotation_vector(np.array([0.1 * index, 0.4, -0.2])) @ scenes.FACING
        frame = scenes.frame(
            t_body_cam_m=place,
            sun_direction_body=(0.3, -0.4, 1.0),
            R_cam_from_body=turned,
            others=(BodyState(scenes.FACING, np.array([-1.0, 0.4, 7.0])),),
        )
        states[where] = replace(frame, index=index, t_s=10.0 * index)
    following = [*list(states.values())[1:], None]
    return {
        where: replace(state, onward=_onward(state, after))
        for (where, state), after in zip(states.items(), following, strict=True)
    }


def _onward(state: FrameState, following: FrameState | None) -> Onward:
    return Onward(0.0 if following is None else 10.0, state.after, lambda: following)


def _look(state: FrameState, scene: Scene) -> Look:
    return Look(Standpoint(state, Mount(), SEED, "annotator"), scene, RayCaster(scene).through)


def _looks() -> Mapping[str, Look]:
    scene = _scene()
    return {where: _look(state, scene) for where, state in _states().items()}


def _arrays(look: Look) -> list[AnyArray]:
    view, state = look.view(), look.state.craft
    return [
        *(view.part_id, view.triangle, view.depth_m, view.normal_cam, view.lit, view.keypoints_px),
        *(state.R_cam_from_body, state.t_body_cam_m, look.scene.spacecraft.parts[0].vertices_body_m),
    ]


def _kind(labels: Labels) -> tuple[Any, ...]:
    """Keys of the labels; name, type and shape in a pixel of the arrays."""
    arrays = sorted((name, array.dtype.str, array.shape[2:]) for name, array in labels.arrays.items())
    return tuple(sorted(labels.values)), tuple(arrays)


def _assert_equal(one: Labels, other: Labels, why: str) -> None:
    assert json.dumps(_plain(one), sort_keys=True) == json.dumps(_plain(other), sort_keys=True), why
    assert one.arrays.keys() == other.arrays.keys(), why
    for name, array in one.arrays.items():
        np.testing.assert_array_equal(array, other.arrays[name], f"{name}: {why}")


def _plain(labels: Labels) -> Any:
    return json.loads(json.dumps(dict(labels.values), default=lambda x: np.asarray(x).tolist()))
