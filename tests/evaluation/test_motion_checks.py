"""Faults planted in the flow and the base colour of a dataset whose flow has a closed form."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cuboid
import numpy as np
import pytest

from posse_core._dataset.dataset import Dataset
from posse_core._evaluation.result import Report
from posse_core._evaluation.validate import validate

FRAME = 1
CHECKS = {"albedo", "flow-visible", "optical-flow", "scene-flow"}


@pytest.fixture(scope="module")
def flowing(dataset_folder, tmp_path_factory) -> Path:
    """Frames 0, 1, 2 and 3, 4, 5 are two sequences; not to be changed."""
    folder = tmp_path_factory.mktemp("flowing") / "d"
    shutil.copytree(dataset_folder, folder)
    return cuboid.add_flow(folder)


@pytest.fixture
def folder(flowing, tmp_path):
    shutil.copytree(flowing, tmp_path / "d")
    return tmp_path / "d"


def prove(folder: Path) -> Report:
    return validate(Dataset(folder), lambda places, frames: places)


def change_array(
    folder: Path, name: str, alter: Callable[[np.ndarray], None], frame: int = FRAME
) -> None:
    path = folder / f"truth/{frame:06d}.npz"
    with np.load(path) as file:
        arrays = dict(file)
    alter(arrays[name])
    np.savez_compressed(path, **arrays)
    cuboid.seal(folder, 6)


def change_line(folder: Path, frame: int = FRAME, **labels: object) -> None:
    lines = cuboid.read_lines(folder)
    lines[frame] |= labels
    cuboid.write_lines(folder, lines)


def faults(folder: Path) -> dict[str, list[tuple[int | None, str]]]:
    """The faults of each check that found any."""
    found = {result.name: result.faults for result in prove(folder).results if result.faults}
    return {name: [(fault.frame, fault.message) for fault in each] for name, each in found.items()}


def test_a_clean_dataset_passes(flowing):
    report = prove(flowing)
    assert report.passed
    assert {result.name: result.checked for result in report.results if result.name in CHECKS} == (
        dict.fromkeys(CHECKS, 6)
    )


def test_flow_to_the_frame_before(folder):
    """What a program makes that mixes up the two frames: the flow's sign."""
    change_array(folder, "optical_flow_px", lambda flow: np.negative(flow, out=flow))
    (found,) = faults(folder)["optical-flow"]
    assert found[0] == FRAME
    assert "is not the poses' in" in found[1]


def test_flow_with_rows_before_columns(folder):
    change_array(folder, "optical_flow_px", lambda flow: flow.__setitem__(..., flow[..., ::-1].copy()))
    assert faults(folder)["optical-flow"][0][0] == FRAME


def test_flow_a_twentieth_of_a_pixel_off(folder):
    change_array(folder, "optical_flow_px", lambda flow: np.add(flow, 0.05, out=flow))
    (found,) = faults(folder)["optical-flow"]
    assert "0.0707 px in the middle" in found[1]


def test_flow_outside_the_mask(folder):
    change_array(folder, "optical_flow_px", lambda flow: flow.__setitem__((0, 0), 1.0))
    assert faults(folder) == {
        "optical-flow": [(FRAME, "optical_flow_px is given in 1 pixels outside the mask")]
    }


def test_flow_that_is_missing(folder):
    def remove(flow):
        row, column = np.argwhere(np.isfinite(flow[..., 0]))[0]
        flow[row, column] = np.nan

    change_array(folder, "optical_flow_px", remove)
    ((_, message),) = faults(folder)["optical-flow"]
    assert message.startswith("optical_flow_px is not the poses' in 1 of")


def test_flow_of_a_last_frame(folder):
    """Frame 2 is the last of its sequence, and frame 3 begins another."""
    change_array(folder, "optical_flow_px", lambda flow: flow.__setitem__((0, 0), 1.0), frame=2)
    assert (2, "optical_flow_px is given in 1 pixels, and flow_duration_s is null") in faults(folder)[
        "optical-flow"
    ]


@pytest.mark.parametrize("duration_s", [None, 11.0])
def test_a_duration_that_is_not_that_to_the_next_frame(folder, duration_s):
    change_line(folder, flow_duration_s=duration_s)
    message = f"flow_duration_s is {duration_s}, and the next frame is 10 s later"
    found = faults(folder)
    assert (FRAME, message) in found["optical-flow"]
    assert (FRAME, message) in found["scene-flow"]


def test_a_collected_dataset_may_lack_the_next_frame(folder):
    """The frame that the flow led to was dropped, so nothing can be said of it."""
    lines = cuboid.read_lines(folder)
    for line in lines:
        line["origin"] = ["d", line["index"]]
    lines[2]["t_s"] += 10  # the frame that was 10 s after frame 1 is not there
    cuboid.write_lines(folder, lines)
    assert CHECKS.isdisjoint(faults(folder))


def test_everything_visible(folder):
    """Faces that turn away are hidden by the others."""
    change_array(folder, "flow_visible", lambda visible: np.logical_or(visible, True, out=visible))
    messages = [message for frame, message in faults(folder)["flow-visible"] if frame == FRAME]
    assert any("is labelled visible, and the next frame's mesh is" in message for message in messages)
    assert any("whose flow leaves the image" in message for message in messages)


def test_nothing_visible(folder):
    change_array(folder, "flow_visible", lambda visible: np.logical_and(visible, False, out=visible))
    messages = [message for frame, message in faults(folder)["flow-visible"] if frame == FRAME]
    assert messages
    assert all("labelled hidden, and in the next frame nothing is before it" in m for m in messages)


def test_scene_flow_in_the_axes_of_one_camera(folder):
    """A flow that leaves out the camera's turn: here, by a rotation of the vectors."""
    R = np.float32([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    change_array(folder, "scene_flow_m", lambda flow: np.matmul(flow.copy(), R, out=flow))
    ((frame, message),) = faults(folder)["scene-flow"]
    assert frame == FRAME
    assert "is not the poses' in" in message


def test_scene_flow_two_millimetres_off(folder):
    change_array(folder, "scene_flow_m", lambda flow: np.add(flow, 0.002, out=flow))
    assert set(faults(folder)) == {"scene-flow"}


def test_scene_flow_outside_the_mask(folder):
    change_array(folder, "scene_flow_m", lambda flow: flow.__setitem__((0, 0), 1.0))
    assert faults(folder) == {
        "scene-flow": [(FRAME, "scene_flow_m is not given where it must be in 1 pixels")]
    }


def test_a_colour_that_is_no_reflectance(folder):
    change_array(folder, "base_color_rgb", lambda color: np.multiply(color, 255, out=color))
    ((frame, message),) = faults(folder)["albedo"]
    assert frame == FRAME
    assert message.startswith("base_color_rgb is not within 0 and 1 in")


def test_a_colour_beside_the_spacecraft(folder):
    change_array(folder, "base_color_rgb", lambda color: color.__setitem__((0, 0), 0.0))
    assert faults(folder) == {"albedo": [(FRAME, "base_color_rgb and the mask differ in 1 pixels")]}
