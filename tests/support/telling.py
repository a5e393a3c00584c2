"""A detector and a finder of keypoints that tell what the labels say."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.dataset import Dataset
from posse_core._interfaces.detector import Detection, Detector, KeypointFinder
from posse_core._model.label_line import LabelLine


class Labels(Detector):
    """Tells the labels of the image that it is shown."""

    classes = ("brick", "plate")

    def __init__(self, dataset: Dataset, shift_px: float = 0.0) -> None:
        self.shift_px = shift_px
        self.lines = {dataset.image(i).tobytes(): dataset[i] for i in range(len(dataset))}

    def load(self, path: Path) -> None:
        raise NotImplementedError

    def line(self, image: AnyArray) -> LabelLine:
        return self.lines[image.tobytes()]

    def predict(self, images):
        found = []
        for image in images:
            line = self.lines.get(image.tobytes())  # of a part of an image nothing is told
            box = None if line is None else line.box_visible_px
            moved = [] if box is None else [np.array(box, float) + np.array([self.shift_px, 0, 0, 0])]
            found.append([Detection(line.spacecraft, 0.9, b) for b in moved])
        return found


class Points(KeypointFinder):
    """Tells where the labels say the keypoints are."""

    classes = ("brick", "plate")

    def __init__(self, dataset: Dataset) -> None:
        self.labels = Labels(dataset)
        self.keypoints_body_m = {
            name: np.array(list(craft.keypoints_body_m.values()))
            for name, craft in dataset.spacecraft_by_name.items()
        }

    def load(self, path: Path) -> None:
        raise NotImplementedError

    def find(self, image, detections):
        points = np.array([p[:2] for p in self.labels.line(image).keypoints.values()])
        return [Detection(d.label, d.score, d.box_px, points, np.ones(len(points))) for d in detections]
