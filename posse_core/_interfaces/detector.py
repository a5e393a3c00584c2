"""Interfaces of detectors, which learn from a dataset and find spacecraft in images."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from posse_core._arrays import AnyArray, BoolArray, FloatArray
from posse_core._frames import quaternion_from_matrix
from posse_core._interfaces.trust import trust
from posse_core._plugins.component import Component, OptionsT

if TYPE_CHECKING:  # at run time this import would slow down every command that loads plugins
    from posse_core._dataset.images import LabelledImages


@dataclass(frozen=True)
class KeypointPlaces:
    """Where each keypoint of a spacecraft may be in an image: M places for each of K keypoints.

    Where a spacecraft looks alike from several sides, a keypoint may be at one place or at another; the
    places on which all keypoints agree are those of a pose.

    Attributes:
        points_px: (K, M, 2) u, v, the most likely place first.
        sigma_px: (K, M) standard deviation of each coordinate, if the keypoint is there.
        share: (K, M) probability that it is there, 0 for a place that does not count. What is left of
            each row's sum to 1 is the probability that it is anywhere.
    """

    points_px: FloatArray
    sigma_px: FloatArray
    share: FloatArray


@dataclass(frozen=True)
class Detection:
    """One detected spacecraft.

    Attributes:
        label: the class, such as ``aqua``.
        score: confidence, 0 … 1.
        box_px: (4,) x, y, width, height; x and y are the indices of the first pixel column and row.
        keypoints_px: (K, 2) u, v in the order of the class's keypoints, or None if none were sought.
        keypoints_sigma_px: (K,) standard deviation of each coordinate, or None.
        places: where else the keypoints may be; None if the finder knows one place of each.
    """

    label: str
    score: float
    box_px: FloatArray
    keypoints_px: FloatArray | None = None
    keypoints_sigma_px: FloatArray | None = None
    places: KeypointPlaces | None = None

    def with_places(self, places: KeypointPlaces) -> Detection:
        """The same with the places where its keypoints may be, each being at the first of its own."""
        return replace(
            self,
            keypoints_px=np.ascontiguousarray(places.points_px[:, 0]),
            keypoints_sigma_px=np.ascontiguousarray(places.sigma_px[:, 0]),
            places=places,
        )


@dataclass(frozen=True)
class PoseEstimate:
    """A pose with its uncertainty.

    Attributes:
        R_cam_from_body: (3, 3).
        t_body_cam_m: (3,) position of the body's origin in camera axes.
        covariance: (6, 6) of a small rotation in camera axes (rad) and of the position (m), in this
            order.
        inliers: (K,) points within three standard deviations.
        residual: root mean square of the inliers' residuals, in standard deviations.
        detection: the detection that the keypoints belong to, if they were found in an image.
        certainty: probability that this is no other pose which looks alike, 0 … 1; the covariance knows
            nothing of those.
    """

    R_cam_from_body: FloatArray
    t_body_cam_m: FloatArray
    covariance: FloatArray
    inliers: BoolArray
    residual: float
    detection: Detection | None = None
    certainty: float = 1.0

    @property
    def q_cam_from_body(self) -> FloatArray:
        """(4,) unit quaternion of :attr:`R_cam_from_body`, scalar first, w ≥ 0."""
        return quaternion_from_matrix(self.R_cam_from_body)

    @property
    def range_m(self) -> float:
        """Distance between the camera and the body's origin."""
        return float(np.linalg.norm(self.t_body_cam_m))

    @property
    def trust(self) -> float:
        """Probability, by the covariance and the certainty, that the position is wrong by less than 5 %
        of the range, and the attitude by less than 5°: 0 … 1. An image without a spacecraft gives poses
        near 0."""
        return self.certainty * trust(self.t_body_cam_m, self.covariance)

    def __repr__(self) -> str:
        of = "" if self.detection is None else f" of {self.detection.label}"
        x, y, z = self.t_body_cam_m
        return f"<PoseEstimate{of}: at {x:.2f}, {y:.2f}, {z:.2f} m, {self.inliers.sum()} inliers>"


class Model(Component[OptionsT]):
    """A network that is trained, or read from a file. Its capabilities say what it can do."""

    shipped: Mapping[tuple[str, ...], Path] = {}
    """The trained networks that the plugin ships: names of spacecraft → the model file that knows these.
    Of those that know all that are asked for, the one of the fewest is taken; the first, where none is
    asked for."""

    classes: Sequence[str] = ()
    """The classes that it can find, available after :meth:`load`."""

    @abstractmethod
    def load(self, path: Path) -> None:
        """Load the weights from a model file.

        Raises:
            posse_core.InputError: The file is not a model of this network.
        """

    def train(self, dataset: LabelledImages, folder: Path) -> Path:
        """Train on the dataset's train part.

        Checkpoints and learning curves are written to ``folder``; an interrupted training resumes from
        the last checkpoint.

        Returns:
            The file of the trained model.
        """
        raise NotImplementedError

    def export_onnx(self, path: Path, images: Sequence[AnyArray]) -> Mapping[str, float]:
        """Write the network as ONNX and compare its outputs on ``images`` with those of the network.

        Returns:
            Name of an output → largest difference found.

        Raises:
            posse_core.ComponentError: A difference is larger than allowed; no file is written.
        """
        raise NotImplementedError

    def write_int8(self, path: Path, out: Path, seen: Sequence[tuple[AnyArray, FloatArray]]) -> None:
        """Write an 8-bit version of the file ``path`` of :meth:`export_onnx` to ``out``.

        Args:
            path: the ONNX file.
            out: the file to write.
            seen: images, each with the box (4,) x, y, width, height of the spacecraft in it. The network
                is run on them to find the ranges of its activations.
        """
        raise NotImplementedError


class Detector(Model[OptionsT]):
    """Finds spacecraft in images."""

    @abstractmethod
    def predict(self, images: Sequence[AnyArray]) -> Sequence[Sequence[Detection]]:
        """Return the detections in each image, best first; their boxes are within the image.

        Args:
            images: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.
        """


class KeypointFinder(Model[OptionsT]):
    """Finds the keypoints of a spacecraft inside its box."""

    keypoints_body_m: Mapping[str, FloatArray]
    """Class → (K, 3) keypoints in metres, body axes, in the order in which they are found; NaN for those
    that have no place of their own on the body, such as those that a joint carries.

    It is available after :meth:`load`.
    """

    knows_any_roll: bool = False
    """Whether it finds keypoints as well in an image that is turned by any angle. Where a pose is not
    sure, the image is looked at turned by quarter turns too then. It is available after :meth:`load`."""

    @abstractmethod
    def find(self, image: AnyArray, detections: Sequence[Detection]) -> Sequence[Detection]:
        """Return the detections with their keypoints."""
