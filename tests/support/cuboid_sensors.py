"""Readings of sensors for the cuboid's dataset, made by hand: an image, points, events, temperatures,
and a reading that is like none of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cuboid
import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.layout import reading_file
from posse_core._dataset.sensors import SensorInfo, write_sensor
from posse_core._model.camera import Camera
from posse_core._model.mount import Mount

RATE_HZ = 0.5
"""Of the scanner; frames are 10 s apart."""
SMALL = Camera(80, 60, 75.0, 75.0, 39.5, 29.5, 0.036)
"""The cuboid's camera with pixels of twice the size, whose centres are between those of the other."""
WINDOW_US = 10_000
SENSORS = (
    SensorInfo("second", "camera", Mount(), None, cuboid.CAMERA),
    SensorInfo("scanner", "lidar", Mount(), RATE_HZ, None),
    SensorInfo("eye", "dvs", Mount(), None, SMALL),
    SensorInfo("warmth", "bolometer", Mount(), None, SMALL),
    SensorInfo("gauge", "dosimeter", Mount(), None, None),
)


def add_readings(folder: Path) -> Path:
    """Give every frame of the cuboid's dataset readings of all sensors."""
    lines = cuboid.read_lines(folder)
    for sensor in SENSORS:
        (folder / "sensors" / sensor.name).mkdir(parents=True)
        write_sensor(sensor, folder / "sensors" / f"{sensor.name}.json")
    for line in lines:
        truth = dict(np.load(folder / line["truth"]))
        image = cv2.imread(str(folder / line["image"]), cv2.IMREAD_UNCHANGED)
        line["sensors"] = {
            "second": [_reading(folder, line, "second", 0, _second(line), {}, 255 - image)],
            "scanner": [
                _reading(folder, line, "scanner", number, {"beams": truth["depth_m"].size}, points)
                for number, points in enumerate(scans(truth))
            ],
            "eye": [_reading(folder, line, "eye", 0, {"window_s": WINDOW_US / 1e6}, events(truth))],
            "warmth": [_reading(folder, line, "warmth", 0, {}, temperatures(truth))],
            "gauge": [_reading(folder, line, "gauge", 0, *_gauge(line["index"]))],
        }
    cuboid.write_lines(folder, lines)
    return folder


def scans(truth: dict[str, AnyArray]) -> list[dict[str, AnyArray]]:
    """Five scans of a frame: a beam a pixel, NaN where it misses; later ones are 0.1 m farther."""
    v, u = np.mgrid[: cuboid.CAMERA.height_px, : cuboid.CAMERA.width_px].astype(float)
    rays = np.stack([(u - 79.5) / 150, (v - 59.5) / 150, np.ones_like(u)], axis=-1)
    point_m = (rays * truth["depth_m"][..., None]).reshape(-1, 3)
    part_id = truth["part_id"].ravel()
    intensity = np.where(part_id >= 0, 100.0 * part_id + 7, np.nan)
    return [
        {
            "after_s": np.zeros(len(point_m)),
            "point_sensor_m": point_m + np.array([0, 0, 0.1 * k]),
            "intensity_e": intensity,
            "part_id": part_id,
        }
        for k in range(5)
    ]


def events(truth: dict[str, AnyArray]) -> dict[str, AnyArray]:
    """The left half of the image lightens at first, in the order of columns, and its right half darkens
    thereafter; one event for every pixel of the spacecraft."""
    y, x = np.nonzero(truth["part_id"][::2, ::2] >= 0)
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    return {
        "x": x.astype(np.uint16),
        "y": y.astype(np.uint16),
        "t_us": (x * WINDOW_US // SMALL.width_px).astype(np.int64),
        "p": (x < SMALL.width_px // 2).astype(np.uint8),
    }


def temperatures(truth: dict[str, AnyArray]) -> dict[str, AnyArray]:
    """Each side has one temperature, 250 K to 350 K, before a sky of 4 K."""
    side = truth["part_id"][::2, ::2]
    return {
        "temperature_k": np.where(side >= 0, 250 + 20.0 * side, np.nan),
        "brightness_temperature_k": np.where(side >= 0, 250 + 20.0 * side, 4).astype(np.float32),
        "reflected_k": np.zeros(3),
    }


def _second(line: dict[str, Any]) -> dict[str, Any]:
    names = ("box_visible_px", "box_whole_px", "mask_rle", "keypoints", "part_area_px")
    return {name: line[name] for name in names}


def _gauge(index: int) -> tuple[dict[str, Any], dict[str, AnyArray]]:
    """Names of the core's labels and arrays, with other things in them."""
    labels = {"dose_gy": 0.25 * index, "keypoints": [1, 2], "box_visible_px": {"<b>": "</script>"}}
    arrays = {
        "x": np.zeros(3),
        "t_us": np.zeros(4, np.int64),
        "spectrum": np.ones((2, 3, 4), np.float32),
    }
    return labels, arrays


def _reading(
    folder: Path,
    line: dict[str, Any],
    name: str,
    number: int,
    labels: dict[str, Any],
    arrays: dict[str, AnyArray],
    image: AnyArray | None = None,
) -> dict[str, Any]:
    files = []
    if image is not None:
        files.append(reading_file(name, line["index"], number, ".png"))
        cv2.imwrite(str(folder / files[-1]), image)
    if arrays:
        files.append(reading_file(name, line["index"], number, ".npz"))
        np.savez_compressed(folder / files[-1], **arrays)
    return {
        "t_s": line["t_s"] + number / RATE_HZ,
        "q_sensor_from_body": line["q_cam_from_body"],
        "t_body_sensor_m": line["t_body_cam_m"],
        "v_body_sensor_m_s": [0.0, 0.0, 0.0],
        "omega_body_rad_s": [0.0, 0.0, 0.0],
        "omega_sensor_rad_s": [0.0, 0.0, 0.0],
        "files": files,
        "labels": json.loads(json.dumps(labels)),
    }
