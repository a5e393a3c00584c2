"""A recipe that takes seconds: a box before the Earth, a flat renderer and nets that guess."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from small_run import BOX_OBJ

KEYS: dict[str, Any] = {
    "craft": {"mesh": "box.obj", "scale_m_per_unit": 1.0},
    "workers": 1,
    "seed": 3,
    "data": {
        "frames": 14,
        "apparent_size": [0.3, 0.9],
        "drop": ["few-keypoints"],
        "split": [60, 20, 20],
        "scenario": {
            "orbit": {
                "elements": {
                    "epoch_utc": "2022-01-31T02:02:27",
                    "a_m": 7.08e6,
                    "e": 0.001,
                    "i_deg": 65,
                    "raan_deg": 10,
                    "argp_deg": 20,
                    "mean_anomaly_deg": 30,
                }
            },
            "attitude": {"target": "random"},
            "camera": {"width_px": 64, "height_px": 48, "hfov_deg": 40},
            "sensor": {"auto_exposure": {"longest_s": 0.05}, "exposure_stops": [-1, 1]},
            "sky": {"earth": False, "stars": None},
            "annotators": ["box", "mask", "keypoints", "pose"],
            "writers": [],
            "renderer": "flat",
        },
        "sources": {
            "plain": {"share": 2},
            "noisy": {"share": 1, "set": {"sensor.noise.gaussian_dn": 5.0}},
            "empty": {"share": 1, "craft": False},
        },
    },
    "boxes": {"name": "guess-boxes", "epochs": 3},
    "keypoints": {"name": "guess-keypoints", "epochs": 2},
}


def write_recipe(folder: Path, **more: Any) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "box.obj").write_text(BOX_OBJ)
    path = folder / "recipe.yaml"
    path.write_text(yaml.safe_dump({**KEYS, **more}, sort_keys=False))
    return path
