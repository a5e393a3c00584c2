"""The kit of writers catches what it is there for."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from posse_core import ComponentError, Dataset, InputError, LabelLine, NoOptions, Writer
from posse_core.testing import WriterConformance

PATHS = "test_every_file_is_among_its_paths"
READ = "test_it_can_be_read_back"
BYTES = "test_the_same_dataset_gives_the_same_bytes"
MACHINE = "test_nothing_names_this_machine"
NAMES = "test_names_of_files_are_safe"
WITHIN = "test_it_writes_within_its_folder_alone"
TORN = "test_an_error_ends_it"
MISSING = "test_labels_that_are_not_there"
EXCLUDED = "test_it_writes_what_its_capabilities_do_not_exclude"
LABELS = "test_it_needs_the_labels_alone"

CAUGHT = {
    "nothing": {},
    "a file not returned": {PATHS: "wrote notes.txt and returned neither it"},
    "a path outside": {PATHS: "is not within"},
    "no paths": {PATHS: "returned no paths"},
    "empty frames left out": {READ: "do not show the spacecraft left out"},
    "other names": {READ: "names changed"},
    "the time": {BYTES: "differ from what was written before"},
    "of the last dataset": {BYTES: "from a writer that was used"},
    "absolute paths": {MACHINE: "has an absolute path"},
    "spaces in a name": {NAMES: "has other characters"},
    "names that differ in case": {NAMES: "upper and lower case are the same"},
    "a file in the working directory": {WITHIN: "working/log.txt"},
    "a file in the dataset": {WITHIN: "dataset/cache.json"},
    "errors swallowed": {TORN: "OSError at the third frame was swallowed"},
    "interrupts swallowed": {TORN: "KeyboardInterrupt at the third frame was swallowed"},
    "a label that is not there": {MISSING: "box_visible_px"},
    "a refusal without a way out": {MISSING: "does not name the annotator"},
    "no distortion": {EXCLUDED: "'pinhole-only' would tell it before"},
    "one body": {EXCLUDED: "with a body beside the target"},
    "reads images": {LABELS: "leave out the capability 'labels-only'"},
    "counts images": {LABELS: "writes something else"},
}


class Spoiled(Writer[NoOptions]):
    """Boxes by image, with one thing wrong."""

    written = 0

    def __init__(self, wrong: str) -> None:
        super().__init__(NoOptions())
        self.wrong = wrong

    def write(self, dataset: Dataset, folder: Path) -> list[Path]:
        wrong = self.wrong
        if wrong == "no distortion" and dataset.camera.distortion is not None:
            raise InputError("boxes are those of a pinhole")
        if wrong == "one body" and dataset.bodies:
            raise InputError("there may be one body alone")
        boxes: dict[str, object] = {}
        self.written += 1
        try:
            for frame in dataset:
                self.add(frame, dataset, boxes)
        except OSError:
            if wrong != "errors swallowed":
                raise
        except KeyboardInterrupt:
            if wrong != "interrupts swallowed":
                raise
        if wrong == "of the last dataset":
            boxes["written"] = self.written
        if wrong == "the time":
            boxes["written"] = time.time_ns()
        if wrong == "counts images":
            boxes["count"] = len(list((dataset.folder / "images").glob("*")))
        name = "all boxes.json" if wrong == "spaces in a name" else "boxes.json"
        (folder / name).write_text(json.dumps(boxes))
        more = []
        if wrong == "a file not returned":
            (folder / "notes.txt").touch()
        if wrong == "names that differ in case":
            (folder / "Boxes.json").touch()
            more = [folder / "Boxes.json"]
        if wrong == "a file in the working directory":
            Path("log.txt").touch()
        if wrong == "a file in the dataset":
            (dataset.folder / "cache.json").touch()
        if wrong == "a path outside":
            more = [dataset.folder]
        return [] if wrong == "no paths" else [folder / name, *more]

    def add(self, frame: LabelLine, dataset: Dataset, boxes: dict[str, object]) -> None:
        wrong = self.wrong
        if not frame.has("box_visible_px"):
            if wrong == "a label that is not there":
                raise KeyError("box_visible_px")
            way_out = "; add 'box' to the scenario's annotators"
            last = "" if wrong == "a refusal without a way out" else way_out
            raise InputError(f"{dataset.folder}: there are no boxes{last}")
        if wrong == "empty frames left out" and frame.box_visible_px is None:
            return
        key = frame.image
        if wrong == "absolute paths":
            key = str(dataset.folder / frame.image)
        if wrong == "other names":
            key = f"frame {frame.index}"
        if wrong == "reads images":
            assert (dataset.folder / frame.image).read_bytes()
        boxes[key] = frame.box_visible_px


@pytest.mark.parametrize("wrong", CAUGHT)
def test_a_wrong_writer_fails_for_its_own_reason(wrong: str) -> None:
    class Case(WriterConformance):
        capabilities = frozenset({"labels-only"})

        def writer(self) -> Writer:
            return Spoiled(wrong)

        def images_in(self, folder: Path) -> list[str]:
            return list(json.loads((folder / "boxes.json").read_text()))

    for test in (name for name in vars(WriterConformance) if name.startswith("test_")):
        reason = CAUGHT[wrong].get(test)
        if reason is not None:
            with pytest.raises((AssertionError, ComponentError, KeyError), match=reason):
                getattr(Case(), test)()
        elif not CAUGHT[wrong]:
            getattr(Case(), test)()
