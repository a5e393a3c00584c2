"""Kalibr: the cameras of a dataset as a camera chain
(https://github.com/ethz-asl/kalibr/wiki/yaml-formats).

A camera's axes are OpenCV's, as in POSSE, and so is the pixel convention: the centre of the first pixel
is (0, 0). ``T_cn_cnm1`` transforms points from the axes of the previous camera to those of this one.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._files.text import text_file
from posse_core._formats.cameras import MountedCamera, cameras_of
from posse_core._formats.needs import refuse_rational_lens
from posse_core._interfaces.writer import Writer


class KalibrWriter(Writer):
    """Writes ``camchain.yaml``: the chaser's camera is ``cam0``, and those of sensors follow by name."""

    def write(self, dataset: Dataset, folder: Path) -> Sequence[Path]:
        """Write ``camchain.yaml``.

        Raises:
            InputError: A lens has a coefficient k₃, or a denominator, which Kalibr's does not have.
        """
        cameras = cameras_of(dataset)
        chain = {f"cam{n}": _camera(each, dataset.folder) for n, each in enumerate(cameras)}
        for n in range(1, len(cameras)):
            previous, own = cameras[n - 1].T_own_from_chaser, cameras[n].T_own_from_chaser
            chain[f"cam{n}"]["T_cn_cnm1"] = (own @ np.linalg.inv(previous)).tolist()
        path = folder / "camchain.yaml"
        with text_file(path) as text:
            yaml.safe_dump(chain, text, sort_keys=False, default_flow_style=None)
        return [path]


def _camera(mounted: MountedCamera, folder: Path) -> dict[str, Any]:
    camera = mounted.camera
    refuse_rational_lens(camera, f"{folder}: Kalibr")
    coefficients = camera.distortion_coefficients.tolist()
    fisheye = camera.distortion is not None and camera.distortion.model == "fisheye"
    if any(coefficients[4:]):
        raise InputError(
            f"{folder}: the lens of {mounted.topic} has k3 = {coefficients[4]:g}, and Kalibr's 'radtan'"
            " has k1, k2, p1 and p2 only; make the dataset with k3 = 0, or export opencv-calibration"
        )
    return {
        "camera_model": "pinhole",
        "intrinsics": [float(x) for x in (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px)],
        "distortion_model": "equidistant" if fisheye else "radtan",
        "distortion_coeffs": coefficients[:4],
        "resolution": [camera.width_px, camera.height_px],
        "rostopic": f"/{mounted.topic}/image_raw",
    }
