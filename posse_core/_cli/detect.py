"""``posse detect``: finds spacecraft in images."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posse_core._cli import completing
from posse_core._cli.common import (
    camera_named,
    image_files,
    json_list,
    model_options,
    options_from,
    refine_options,
    refiner_choice,
    worker_option,
)
from posse_core._cli.progress import phase
from posse_core._errors import InputError
from posse_core._plugins.loading import load_plugins

if TYPE_CHECKING:
    from posse_core._arrays import AnyArray
    from posse_core._detection.pose_detector import PoseDetector
    from posse_core._detection.shapes import Sighting
    from posse_core._model.camera import Camera
    from posse_core._scenario.component import ComponentChoice


@click.command()
@click.argument("images", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--model", type=click.Path(path_type=Path), help="Model that finds spacecraft.")
@click.option("--keypoints", type=click.Path(path_type=Path), help="Model that finds keypoints.")
@click.option(
    "--target",
    shell_complete=completing.crafts,
    help="Find only this spacecraft: the name that the model gives it, or the folder of its package.",
)
@click.option(
    "--camera",
    shell_complete=completing.cameras,
    help="A camera.json, or the name of a published camera such as speed-plus, with which poses are"
    " computed from keypoints.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder for copies of the images with the detections drawn.",
)
@click.option(
    "--score",
    default=0.3,
    show_default=True,
    type=click.FloatRange(0, 1),
    help="Drop detections with a lower score; a third of it is enough where the pose is trusted.",
)
@worker_option
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@refine_options
@model_options
def command(
    images: tuple[Path, ...],
    model: Path | None,
    keypoints: Path | None,
    target: str | None,
    camera: str | None,
    out: Path | None,
    score: float,
    workers: int,
    as_json: bool,
    refine: bool,
    refiner: str,
    refine_ms: float | None,
    overrides: tuple[str, ...],
) -> None:
    """Find spacecraft in IMAGES: files, or folders of them.

    With --camera, boxes are those of the meshes at the poses, where a spacecraft of the name is
    installed or --target is its package, and the pose is plausible.

    Without --model and --keypoints, the models that posse-detect-onnx ships for --target are used,
    by default those of Aqua and Cluster.
    """
    from posse_core._detection.processes import made_by
    from posse_core._files.atomic import write_bytes

    if camera is not None and model is not None and keypoints is None:
        raise InputError("--camera: a pose needs keypoints; name their model by --keypoints")
    files = image_files(images)
    if refine and camera is None:
        raise InputError("--refine: poses need the camera; name it by --camera")
    intrinsics = None if camera is None else camera_named(camera)
    choice = refiner_choice(refine=refine, refiner=refiner, refine_ms=refine_ms)
    given = (model, keypoints), options_from(overrides), target, choice, score
    opened = partial(_searcher, *given, files, intrinsics, is_drawn=out is not None)
    with phase("opening the models"):
        searcher = opened()
    with (
        contextlib.closing(searcher),
        contextlib.nullcontext() if out is None else _made_folder(out, files) as folder,
        json_list() if as_json else contextlib.nullcontext() as echo,
    ):
        made = made_by(searcher, range(len(files)), opened, workers, load_plugins().registry)
        for path, found in zip(files, made, strict=True):
            if folder is not None:
                write_bytes(folder / f"{path.stem}.png", found.drawn_png)
            if echo is not None:
                echo({"image": str(path), "detections": found.rows})
            else:
                text = ", ".join(_as_text(row) for row in found.rows)
                click.echo(f"{path}: {text or 'nothing'}")


@dataclass(frozen=True)
class _Found:
    """What was found in an image.

    Attributes:
        rows: of each detection.
        drawn_png: the image with the detections; empty where it is not to be drawn.
    """

    rows: list[dict[str, Any]]
    drawn_png: bytes


@dataclass(frozen=True)
class _Searcher:
    """Searches in files.

    Attributes:
        detector: of what is sought.
        files: by index.
        camera: that took the images; without it there are no poses.
        is_drawn: whether what is found is drawn.
    """

    detector: PoseDetector
    files: Sequence[Path]
    camera: Camera | None
    is_drawn: bool

    def make(self, index: int) -> _Found:
        """Search in a file.

        Raises:
            InputError: it is not an image that can be read, or not the camera's.
        """
        import cv2

        from posse_core._dataset.files import read_image
        from posse_core._detection.draw import draw

        image = read_image(self.files[index])
        seen = self._seen(image)
        rows = [_as_json(sighting, is_posed=self.camera is not None) for sighting in seen]
        if not self.is_drawn:
            return _Found(rows, b"")
        drawn = draw(image, [sighting.detection for sighting in seen], self.detector.classes)
        return _Found(rows, cv2.imencode(".png", drawn)[1].tobytes())

    def close(self) -> None:
        """Close what refines poses."""
        self.detector.close()

    def _seen(self, image: AnyArray) -> Sequence[Sighting]:
        """What is found in an image, with poses where the camera is known."""
        from posse_core._detection.shapes import Sighting

        if self.camera is None:
            return [Sighting(detection, None) for detection in self.detector.detect(image)]
        return self.detector.sightings(image, self.camera)


def _searcher(
    models: tuple[Path | None, Path | None],
    options: Mapping[str, Any],
    target: str | None,
    refiner: ComponentChoice | None,
    score: float,
    files: Sequence[Path],
    camera: Camera | None,
    *,
    is_drawn: bool,
) -> _Searcher:
    """Open the models.

    Raises:
        InputError: a model cannot be used, or does not know the target.
    """
    from posse_core._detection.opening import open_pose_detector

    detector = open_pose_detector(
        *models,
        load_plugins().registry,
        options,
        target=target,
        refiner=refiner,
        least_score=score,
        has_camera=camera is not None,
    )
    return _Searcher(detector, files, camera, is_drawn)


@contextlib.contextmanager
def _made_folder(out: Path, files: Sequence[Path]) -> Iterator[Path]:
    """The folder to draw into, which becomes ``out`` when all images are drawn."""
    from posse_core._files.atomic import atomic_folder

    stems = [path.stem for path in files]
    twice = next((stem for stem in stems if stems.count(stem) > 1), None)
    if twice is not None:
        raise InputError(f"--out {out}: two images are named {twice!r}; give their folders one by one")
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out}: cannot be a folder: it is a file")
    with atomic_folder(out) as folder:
        yield folder


def _as_json(sighting: Sighting, *, is_posed: bool) -> dict[str, Any]:
    found, pose, refinement = sighting.detection, sighting.pose, sighting.refinement
    row: dict[str, Any] = {
        "label": found.label,
        "score": round(float(found.score), 4),
        "box_px": [round(float(v), 2) for v in found.box_px],
    }
    if found.keypoints_px is None or found.keypoints_sigma_px is None:
        return row
    row["keypoints_px"] = [[round(float(v), 2) for v in point] for point in found.keypoints_px]
    row["keypoints_sigma_px"] = [round(float(v), 2) for v in found.keypoints_sigma_px]
    if is_posed:
        row["pose"] = pose and {
            "q_cam_from_body": pose.q_cam_from_body.tolist(),
            "t_body_cam_m": pose.t_body_cam_m.tolist(),
            "covariance": pose.covariance.tolist(),
            "trust": round(pose.trust, 4),
        }
    if refinement is not None:
        row["refinement"] = {
            "is_better": bool(refinement.is_better),
            "agreement": round(refinement.agreement, 4),
            "agreement_before": round(refinement.agreement_before, 4),
        }
    return row


def _as_text(row: dict[str, Any]) -> str:
    box = " ".join(f"{v:.0f}" for v in row["box_px"])
    text = f"{row['label']} {row['score']:.2f} at {box}"
    if row.get("pose"):
        text += (
            f", {math.hypot(*row['pose']['t_body_cam_m']):.2f} m away, trust {row['pose']['trust']:.2f}"
        )
    if "refinement" in row:
        text += ", refined" if row["refinement"]["is_better"] else ", not refined"
    return text
