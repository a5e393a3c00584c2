"""What formats have in common that reconstruct a static world: the world is the target, in body axes.

Each spacecraft of a dataset is a world of its own, in a folder of its name. The camera's pose in it is
that of the label line, at the frame's instant. Bodies beside the target are no part of it: masks leave
them out.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._formats.images import eight_bit, link_or_copy, write_png
from posse_core._formats.needs import labels_with

NEEDS = ("q_cam_from_body", "t_body_cam_m", "mask_rle")


def frames_by_spacecraft(dataset: Dataset, format_name: str) -> dict[str, list[int]]:
    """Return the positions of the frames of each spacecraft, after checking that the format can hold
    them.

    Raises:
        InputError: The camera has a rolling shutter, joints of a spacecraft move, or a frame lacks a
            label.
    """
    if dataset.camera.line_time_s > 0:
        raise InputError(
            f"{dataset.folder}: {format_name} supports a global shutter only, but camera.line_time_s is"
            f" {dataset.camera.line_time_s:g}; make the dataset with camera.line_time_s=0"
        )
    for name, craft in dataset.spacecraft_by_name.items():
        if craft.joints:
            raise InputError(
                f"{dataset.folder}: {format_name} supports rigid spacecraft only, but joints of {name!r}"
                f" move ({', '.join(joint.name for joint in craft.joints)}); make the dataset without"
                " its key joints"
            )
    positions: dict[str, list[int]] = {}
    for position, labels in enumerate(labels_with(dataset, format_name, NEEDS)):
        positions.setdefault(labels.spacecraft, []).append(position)
    return positions


def write_images(
    dataset: Dataset, positions: Sequence[int], folder: Path, mask_suffix: str = ""
) -> None:
    """Write ``images/`` and ``masks/`` into a folder, with the names of the dataset's images.

    Images of 8 bits are linked; those of 16 bits are converted, because tools that train radiance fields
    read 8 bits only. A mask is 255 on the spacecraft and 0 elsewhere.
    """
    for name in ("images", "masks"):
        (folder / name).mkdir(parents=True)
    for position in positions:
        labels = dataset[position]
        name, image = Path(labels.image).name, dataset.image(position)
        if image.dtype == np.uint8:
            link_or_copy(dataset.folder / labels.image, folder / "images" / name)
        else:
            write_png(folder / "images" / name, eight_bit(image))
        mask = dataset.mask(position).astype(np.uint8) * 255
        write_png(folder / "masks" / f"{name}{mask_suffix}", mask)
