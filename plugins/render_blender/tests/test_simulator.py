"""A simulator whose renderer works in a process of its own."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

import posse_core as posse

SMALL = {
    "camera.width_px": 64,
    "camera.height_px": 48,
    "sky.earth": False,
    "renderer.spp": 4,
    "renderer.threads": 1,
}
FRAMES = 12


def children() -> set[int]:
    """Process ids of this process's children."""
    files = Path("/proc/self/task").glob("*/children")
    return {int(pid) for file in files for pid in file.read_text().split()}


def images(kill_before: int | None) -> list[posse.AnyArray]:
    """A loop of frames at states of its own; before one of them, the renderer's process is killed."""
    others, taken = children(), []
    with posse.open("cluster", renderer="blender", overrides=SMALL) as sim:
        r_rtn_m = np.array([1.0, -9.0, 2.0])
        for index in range(FRAMES):
            if index == kill_before:
                (worker,) = children() - others
                os.kill(worker, signal.SIGKILL)
            frame = sim.frame(sim.state(index, t_s=5.0 * index, r_rtn_m=r_rtn_m))
            taken.append(frame.image)
            r_rtn_m = r_rtn_m * (1 - 0.05 * float(frame.coverage.mean()))
    assert children() <= others
    return taken


@pytest.mark.usefixtures("blender")
def test_a_killed_process_is_replaced_and_changes_no_image() -> None:
    disturbed, undisturbed = images(kill_before=5), images(kill_before=None)
    assert all(image.max() > image.min() for image in undisturbed)
    for ours, expected in zip(disturbed, undisturbed, strict=True):
        np.testing.assert_array_equal(ours, expected)
