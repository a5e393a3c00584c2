"""Detectors for tests that learn at once: the mean box, and the mean places of keypoints within it."""

import json
import struct
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from posse_core import (
    ComponentSpec,
    Detection,
    Detector,
    KeypointFinder,
    ModelCard,
    Options,
    atomic_file,
    hookimpl,
    seen_bodies,
    true_box,
)


class GuessOptions(Options):
    epochs: int = 3
    seconds: float = 0.0
    start: Path | None = None


@hookimpl
def posse_detectors():
    return [
        ComponentSpec(
            name, "a guess", f"posse_guess:{made}", "posse_guess:GuessOptions",
            capabilities=frozenset({task, "train", "onnx"}),
        )
        for name, made, task in (
            ("guess-boxes", "Boxes", "boxes"),
            ("guess-keypoints", "Keypoints", "keypoints"),
        )
    ]  # fmt: skip


class Learner:
    """Sums up to the mean of numbers, an epoch at a time, with a checkpoint after each."""

    net, task = "", ""

    def load(self, path):
        self.card = ModelCard.read(path)
        self.classes = self.card.classes
        self.keypoints_body_m = self.card.keypoint_arrays_m
        with open(path, "rb") as file:
            (length,) = struct.unpack("<Q", file.read(8))
            metadata = json.loads(file.read(length))["__metadata__"]
        self.mean = np.array(json.loads(metadata["mean"]))

    def train(self, dataset, folder):
        card = ModelCard.of_dataset(
            dataset, net=self.net, task=self.task, input_px=64, version="1", options={}
        )
        checkpoint = folder / "last.json"
        if not checkpoint.exists():
            self._write(checkpoint, b"[0, null]")
        while True:
            done, mean = json.loads(checkpoint.read_text())
            if done == self.options.epochs:
                break
            time.sleep(self.options.seconds)
            rows = [
                self.numbers(body)
                for position in dataset.part("train")
                for body in seen_bodies(dataset[position]).values()
            ]
            mean = np.mean(rows, axis=0).tolist()
            self._write(checkpoint, json.dumps([done + 1, mean]).encode())
        card = replace(card, epochs=done)
        header = json.dumps({"__metadata__": {**card.metadata(), "mean": json.dumps(mean)}}).encode()
        self._write(folder / "model.safetensors", struct.pack("<Q", len(header)) + header)
        return folder / "model.safetensors"

    def export_onnx(self, path, images):
        self._write(path, json.dumps(self.mean.tolist()).encode())
        return {"raw": 0.0}

    def _write(self, path, data):
        with atomic_file(path) as file:
            file.write(data)


class Boxes(Learner, Detector):
    net, task = "guess-boxes", "boxes"

    def numbers(self, body):
        return true_box(body).box_px

    def predict(self, images):
        return [[Detection(self.classes[0], 0.5, self.mean)] for _ in images]


class Keypoints(Learner, KeypointFinder):
    net, task = "guess-keypoints", "keypoints"

    def numbers(self, body):
        x, y, width, height = true_box(body).box_px
        points = np.array([point[:2] for point in body.keypoints.values()])
        return (points - [x, y]) / [width, height]

    def find(self, image, detections):
        return [
            replace(
                d,
                keypoints_px=d.box_px[:2] + self.mean * d.box_px[2:],
                keypoints_sigma_px=np.full(len(self.mean), 5.0),
            )
            for d in detections
        ]
