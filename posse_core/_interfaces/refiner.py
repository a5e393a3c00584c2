"""Interface of refiners, which bring the pose of a known spacecraft closer to what an image shows."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from posse_core._arrays import AnyArray, FloatArray
from posse_core._interfaces.detector import PoseEstimate
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._plugins.component import Component, OptionsT


@dataclass(frozen=True)
class RefinerSetting:
    """What is the same for all images of a refiner.

    Attributes:
        spacecraft: that the images show, without joints.
        camera: that takes the images, with its lens.
        renderer: a renderer by its name and its options, opened for a scene, and checked; the refiner
            closes it.
    """

    spacecraft: Spacecraft
    camera: Camera
    renderer: Callable[[str, Mapping[str, Any], Scene], Renderer]


@dataclass(frozen=True)
class Refinement:
    """What a refiner made of the start poses.

    Attributes:
        pose: the refined pose with its covariance or, if the refiner's own test does not say that it is
            better, the start that was chosen, as it was given.
        is_better: whether the test says so.
        agreement: of the image with what would be seen at the pose, 0 … 1.
        agreement_before: the same at the start that the pose came from.
        certainty_left: share of its certainty, 0 … 1, that is left to the likeliest start, if nothing
            was better: 1 if the search ended near it, as it would from a right one.
    """

    pose: PoseEstimate
    is_better: bool
    agreement: float
    agreement_before: float
    certainty_left: float = 0.7


class Refiner(Component[OptionsT]):
    """Refines poses of one spacecraft in the images of one camera.

    It is opened once, refines image after image, as a tracker needs it, and is closed. The same image
    and starts give the same pose, unless an option limits the time.
    """

    @abstractmethod
    def open(self, setting: RefinerSetting) -> None:
        """Prepare; called once, before the first image.

        Raises:
            posse_core.InputError: options and setting do not go together.
            posse_core.ComponentError: this machine lacks what the refiner needs.
        """

    @abstractmethod
    def refine(
        self,
        image: AnyArray,
        starts: Sequence[PoseEstimate],
        sun_direction_cam: FloatArray | None = None,
        box_px: FloatArray | None = None,
    ) -> Refinement:
        """Refine a pose.

        Args:
            image: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16, of the camera's size.
            starts: one pose or several, the likeliest first.
            sun_direction_cam: (3,) unit vector from the spacecraft to the Sun, camera axes; None where
                it is not known, or what shines is no Sun.
            box_px: (4,) x, y, width, height of the box in which a detector saw the spacecraft, or that
                part of it which is lit; None where there was none.
        """

    @abstractmethod
    def close(self) -> None:
        """Free what :meth:`open` took; may be called twice, or without open."""
