"""Makes the contact sheet of sky.md: ``python docs/contact_sheet.py``, with mitsuba installed.

Each image is taken from a position of the camera relative to the spacecraft, at a time on a built-in
scenario's orbit.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from posse_core._arrays import AnyArray
from posse_core._dataset.dataset import Dataset
from posse_core._plugins.loading import Plugins, load_plugins
from posse_core._run.plan import make_plan
from posse_core._run.run import run
from posse_core._scenario.load import load_scenario
from posse_core._trajectory.build import make_trajectory

SHEET = Path(__file__).parent / "images" / "contact_sheet.jpg"
WIDTH_PX, HEIGHT_PX, COLUMNS, STRIP_PX = 400, 300, 4, 22
AQUA_ORBIT_S = 5929.5
LOOK_UP_DEG = {"aqua": (8, 0, 0), "cluster": (0, 0, 0)}
"""Aqua's wing extends far from its origin."""


@dataclass(frozen=True)
class Shot:
    """An image: the spacecraft, seconds after its scenario's epoch, the camera's position in the
    target's RTN axes (m), the gain of starlight, the exposure in seconds (None: automatic)."""

    caption: str
    craft: str
    t_s: float
    r_chaser_rtn_m: tuple[float, float, float]
    stars: float = 1.0
    exposure_s: float | None = None

    @property
    def settings(self) -> tuple[str, float, float]:
        """Shots that have the same are one run."""
        return self.craft, self.stars, self.exposure_s or 0.0


SHOTS = (
    Shot("Before the Pacific", "aqua", 5203.5, (17, -5, 11)),
    Shot("Before Arabia", "aqua", 242 + 5 * AQUA_ORBIT_S, (16, -13, 5)),
    Shot("Before southern Africa", "aqua", 5350 + 5 * AQUA_ORBIT_S, (18, 9, 6)),
    Shot("Before the Earth, from perigee", "cluster", 0, (8, -0.8, 1.6)),
    Shot("Limb at noon", "aqua", 5445, (11, -10, 14)),
    Shot("Limb, low Sun behind the camera", "aqua", 726, (7, -18, 7)),
    Shot("Terminator", "aqua", 930, (13, -8, 12)),
    Shot("Half Earth, from 45,000 km", "cluster", 16588, (7.5, 2.2, -0.3)),
    Shot("Dark sky, lit by Sun and Earth", "aqua", 121, (-11, -15, 9)),
    Shot("Dark sky, lit by the Sun alone", "cluster", 72987, (-5, 3.5, 4.5)),
    Shot("Stars, their light raised", "cluster", 96210, (-4, 4, 5), 2e6),
    Shot("Midnight, true starlight, 20 s", "aqua", 2420, (-12, 14, 10), 1.0, 20.0),
    Shot("Last of the full Sun", "aqua", 1500, (5, -19, 7), 1.0, 1.2e-5),
    Shot("Half of the Sun", "aqua", 1513.5, (5, -19, 7), 1.0, 1.2e-5),
    Shot("Umbra, twilight behind", "aqua", 1560, (2, 19, -6), 1.0, 1e-3),
    Shot("Sunrise", "aqua", 3558, (1, -20, -5), 1.0, 1e-4),
    Shot("Strong shadow", "aqua", 5445, (-4, 19, -5)),
    Shot("Strong shadow", "cluster", 60000, (4.5, 4.5, -1.5)),
    Shot("Close, a part", "aqua", 5082, (4, 1, 6)),
    Shot("Close, a part", "cluster", 3317, (0.5, -2, 2.2)),
    Shot("100 m, before the Earth", "aqua", 5324 + 8 * AQUA_ORBIT_S, (80, 40, 45)),
    Shot("400 m", "aqua", 605, (60, -360, 170)),
    Shot("60 m", "cluster", 186000, (35, 20, 44)),
    Shot("200 m", "cluster", 110000, (90, 80, 160)),
)


def main() -> None:
    """Render and paste the sheet."""
    plugins = load_plugins()
    cells: dict[Shot, AnyArray] = {}
    with tempfile.TemporaryDirectory() as folder:
        for number, settings in enumerate(sorted({shot.settings for shot in SHOTS})):
            shots = [shot for shot in SHOTS if shot.settings == settings]
            cells |= zip(shots, pictures(shots, Path(folder) / str(number), plugins), strict=True)
    rows = [SHOTS[i : i + COLUMNS] for i in range(0, len(SHOTS), COLUMNS)]
    sheet = np.vstack([np.hstack([captioned(cells[shot], shot) for shot in row]) for row in rows])
    cv2.imwrite(str(SHEET), sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


def pictures(shots: list[Shot], folder: Path, plugins: Plugins) -> list[AnyArray]:
    """(H, W, 3) RGB of shots that have the same settings."""
    exposure_s = shots[0].exposure_s
    exposure: dict[str, object] = {"auto_exposure": {"percentile": 98, "level": 0.7, "shortest_s": 1e-6}}
    if exposure_s is not None:
        exposure = {"exposure_s": exposure_s, "motion_blur": {"instants": 8}}
    changes = {
        "times": {"t_s": [shot.t_s for shot in shots]},
        "camera": {"width_px": WIDTH_PX, "height_px": HEIGHT_PX, "hfov_deg": 54},
        "attitude.camera": {"law": "pointing-error", "bias_deg": LOOK_UP_DEG[shots[0].craft]},
        "sky.stars.gain": shots[0].stars,
        "sensor": {
            "f_number": 1.2,
            **exposure,
            "color": "rgb",
            "response": "srgb",
        },
        "renderer": {"name": "mitsuba", "spp": 128},
        "annotators": ["box"],
        "writers": [],
    }
    scenario = load_scenario(shots[0].craft, plugins.registry, changes)
    trajectory = make_trajectory(scenario, plugins.registry)
    places_m = np.array([shot.r_chaser_rtn_m for shot in shots], dtype=float)
    path = folder.with_suffix(".npz")
    np.savez(
        path,
        epoch_utc=trajectory.epoch_utc,
        t_s=trajectory.t_s,
        r_target_eci_m=trajectory.r_target_eci_m,
        v_target_eci_m_s=trajectory.v_target_eci_m_s,
        r_chaser_rtn_m=places_m,
        v_chaser_rtn_m_s=np.zeros_like(places_m),
    )
    changes["propagator"] = {"name": "file", "path": str(path)}
    plan = make_plan(load_scenario(shots[0].craft, plugins.registry, changes), plugins.registry)
    executor = plugins.registry.create(
        "executor", "local", plugins.registry.options("executor", "local", {})
    )
    run(plan, str(folder), plugins, executor, resume=False, progress=lambda results, *_: results)
    return [Dataset(folder).image(i) for i in range(len(shots))]


def captioned(picture: AnyArray, shot: Shot) -> AnyArray:
    """The picture over a strip with its caption, and a border."""
    strip = np.zeros((STRIP_PX, WIDTH_PX, 3), dtype=np.uint8)
    text = f"{shot.craft.capitalize()}. {shot.caption}"
    cv2.putText(strip, text, (6, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (230,) * 3, 1, cv2.LINE_AA)
    return np.pad(np.vstack([picture, strip]), ((2, 2), (2, 2), (0, 0)))


if __name__ == "__main__":
    main()
