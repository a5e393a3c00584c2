"""Makes the sheet of the family in spacecraft.md: ``python docs/family_sheet.py``, with posse-raster.

The craft of the seeds 0 … 23 at random attitudes, each from a place of its own on the Sun's side.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import posse_core
from posse_core._arrays import AnyArray
from posse_core._frames import R_about, R_eci_from_rtn, R_with_z, unit
from posse_core._randomness import random_generator

SHEET = Path(__file__).parent / "images" / "family.jpg"
WIDTH_PX, HEIGHT_PX, COLUMNS, COUNT = 400, 300, 6, 24
FOV_DEG, FILLED = 30, 1.05


def main() -> None:
    """Render and paste the sheet."""
    cells = [picture(seed) for seed in range(COUNT)]
    rows = [np.hstack(cells[k : k + COLUMNS]) for k in range(0, COUNT, COLUMNS)]
    cv2.imwrite(str(SHEET), np.vstack(rows)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


def picture(seed: int) -> AnyArray:
    """(H, W, 3) RGB of a craft."""
    changes = {
        "target": {"name": "family", "seed": seed},
        "times": {"t_s": [5203.5]},
        "attitude": {"target": "nadir"},
        "camera": {"width_px": WIDTH_PX, "height_px": HEIGHT_PX, "hfov_deg": FOV_DEG},
        "sky": {"earth": True},
        "sensor": {
            "auto_exposure": {"percentile": 97, "level": 0.75},
            "color": "rgb",
            "response": "srgb",
        },
        "renderer": {"name": "raster"},
        "annotators": ["box"],
        "writers": [],
    }
    with posse_core.open("aqua", overrides=changes) as simulator:
        rng = random_generator(seed, -1, "sheet")
        here, motion = simulator.state(0), simulator.trajectory
        sun_eci = unit(here.r_sun_eci_m - here.r_target_eci_m)
        aside = R_with_z(sun_eci) @ R_about((0.0, 0.0, 1.0), rng.uniform(0.0, 2.0 * np.pi))
        lean = rng.uniform(0.5, 1.0)
        away_eci = aside @ (np.sin(lean), 0.0, np.cos(lean))
        R_eci_from_rtn_axes = R_eci_from_rtn(motion.r_target_eci_m[0], motion.v_target_eci_m_s[0])
        low, high = simulator.spacecraft.bounds_body_m
        distance_m = FILLED * float(np.linalg.norm(high - low)) / np.radians(FOV_DEG)
        q_eci_from_body = unit(rng.standard_normal(4))
        state = simulator.state(
            0, r_rtn_m=distance_m * R_eci_from_rtn_axes.T @ away_eci, q_eci_from_body=q_eci_from_body
        )
        return simulator.frame(state).image


if __name__ == "__main__":
    main()
