"""Makes the documentation's pictures of pages: ``python docs/page_pictures.py [FOLDER]``, with
Chromium and posse-raster.

Without FOLDER they are those of the keypoint picker and of ``posse annotate``. FOLDER is where
``docs/tutorials/run.py`` ran the tutorials; then they are the tutorials' pictures and that of a flight.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from click.testing import CliRunner

import posse_core
from posse_core._arrays import AnyArray
from posse_core._cli.annotate import command
from posse_core._plugins.loading import load_plugins
from posse_core._view.picker.page import picker_page

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from browser import Tab, opened

IMAGES = Path(__file__).with_name("images")
QUALITY = 88
SETTLED = "new Promise((done) => setTimeout(done, 600))"
OVERLAY_PX = 780
CAMERA = {"camera.hfov_deg": 70}
WRONG = "T1"
"""The keypoint that is clicked 30 px off, to show what is told of it."""

# picture → (file that a tutorial makes, width of the picture, px)
MADE = {
    "aqua": ("your-spacecraft/aqua.png", 800),
    "motion": ("your-spacecraft/motion.png", 800),
    "look": ("your-spacecraft/look.png", 800),
    "poses": ("your-spacecraft/poses.png", 900),
    "one": ("fly-it/one.png", 512),
    "loop": ("fly-it/loop.png", 700),
    "flight": ("fly-it/flight.png", 900),
    "real": ("synthetic-to-real/real.png", 900),
}


def save(name: str, picture: AnyArray, width_px: int) -> None:
    height_px = round(width_px * picture.shape[0] / picture.shape[1])
    small = cv2.resize(picture, (width_px, height_px), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(IMAGES / f"{name}.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def shoot(
    name: str,
    page: Path,
    size_px: tuple[int, int],
    width_px: int,
    drive: Callable[[Tab], None] = lambda tab: None,
) -> None:
    """Take a picture of a page in a window of a size, after it was driven."""
    with (
        tempfile.TemporaryDirectory() as downloads,
        opened(page, Path(downloads), width=size_px[0], height=size_px[1]) as tab,
    ):
        tab.tell(SETTLED)
        drive(tab)
        tab.tell(SETTLED)
        taken = np.frombuffer(tab.picture(), np.uint8)
        if tab.errors:
            sys.exit(f"{page}: {tab.errors}")
    save(name, cv2.imdecode(taken, cv2.IMREAD_COLOR), width_px)


def frame(index: int) -> Callable[[Tab], None]:
    """Go to a frame of a viewer or a flight."""

    def drive(tab: Tab) -> None:
        tab.tell(f"location.hash = '#frame={index}'; window.onhashchange?.()")

    return drive


def worst_frames(tab: Tab) -> None:
    """Go to the last chapter of an evaluation."""
    tab.tell("[...document.querySelectorAll('h2')].at(-1).scrollIntoView()")


def picker() -> None:
    """Aqua's keypoints, after its corner at the front was clicked."""
    registry = load_plugins().registry
    craft = registry.create("scene", "aqua").build()
    page = Path("keypoints.html").absolute()
    page.write_bytes(picker_page(craft, (0.0, 0.0, 0.0)))

    def drive(tab: Tab) -> None:
        x, y, width, height = tab.place("#mesh")
        tab.wheel(x + 0.55 * width, y + 0.5 * height, -80)
        corner = craft.keypoints_body_m["T5"].tolist()
        u, v = tab.tell(f"view.toCanvas({corner})")
        tab.click(x + u, y + v)

    shoot("picker", page, (1250, 700), 1250, drive)


def annotate() -> None:
    """Frames of Aqua as photographs, with points as a person clicks them and one that is wrong."""
    made = posse_core.run("aqua", "d", renderer="raster", frames=3, overrides=CAMERA)
    shutil.copytree("d/images", "photos")
    shutil.copy("d/camera.json", "camera.json")
    rng = np.random.default_rng(0)
    places = {
        Path(labels.image).name: {
            name: [point.u_px + rng.normal(0, 0.5), point.v_px + rng.normal(0, 0.5)]
            for name, point in labels.keypoints.items()
            if point.visibility == 2 and point.u_px is not None and point.v_px is not None
        }
        for labels in made
    }
    points = Path("points.json").absolute()
    given = ["photos", "--target", "aqua", "--camera", "camera.json"]

    def drive(tab: Tab) -> None:
        document = tab.send("DOM.getDocument")["root"]["nodeId"]
        node = tab.send("DOM.querySelector", nodeId=document, selector="#file")["nodeId"]
        tab.send("DOM.setFileInputFiles", nodeId=node, files=[str(points)])
        tab.tell(SETTLED)

    CliRunner().invoke(command, given, catch_exceptions=False)
    points.write_text(json.dumps({"spacecraft": "aqua", "photos": places}))
    shoot("annotate", Path("photos/annotate.html").absolute(), (1250, 760), 1250, drive)
    places["000000.png"][WRONG][0] += 30
    points.write_text(json.dumps({"spacecraft": "aqua", "photos": places}))
    CliRunner().invoke(command, [*given, "--points", "points.json"])  # fails, since a point is wrong
    overlay = cv2.imread("photos/labelled/overlays/000000.png.jpg")
    save("annotate-overlay", overlay, round(OVERLAY_PX * overlay.shape[1] / overlay.shape[0]))


def tutorials(folder: Path) -> None:
    """Pictures of what the tutorials made."""
    for name, (file, width_px) in MADE.items():
        save(f"tutorials/{name}", cv2.imread(str(folder / file)), width_px)
    craft, flown = folder / "your-spacecraft", folder / "fly-it"
    shoot("tutorials/keypoints", craft / "proposed" / "keypoints.html", (1200, 800), 1000)
    shoot("tutorials/view", craft / "frames" / "view.html", (1400, 1260), 1000, frame(100))
    shoot("tutorials/eval", craft / "eval.html", (1400, 1300), 900)
    real = folder / "synthetic-to-real" / "real.html"
    shoot("tutorials/real-eval", real, (1000, 1154), 800, worst_frames)
    shoot("tutorials/flight-page", flown / "approach" / "flight.html", (1400, 1500), 1000, frame(60))
    shoot("tutorials/visit", flown / "visit" / "flight.html", (1400, 1500), 1000, frame(25))
    shoot("flight", flown / "approach" / "flight.html", (1400, 1500), 896, frame(45))


def main(*folders: str) -> None:
    if folders:
        tutorials(Path(folders[0]))
        return
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        picker()
        annotate()


if __name__ == "__main__":
    main(*sys.argv[1:])
