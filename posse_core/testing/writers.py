"""The conformance class for writers."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
from abc import abstractmethod
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import IMAGES, TRUTH
from posse_core._errors import InputError
from posse_core._interfaces.writer import Writer
from posse_core._model.label_line import LabelLine
from posse_core._simulator.returned import checked_paths
from posse_core.testing.conformance import Conformance
from posse_core.testing.datasets import VARIANTS, small_dataset

_NEEDS = {
    "a lens that distorts": {"pinhole-only"},
    "a rational lens": {"pinhole-only", "no-rational-lens"},
    "a rolling shutter": {"global-shutter-only"},
    "joints that move": {"no-joints"},
    "a body beside the target": set(),
}
"""Dataset of :data:`posse_core.testing.datasets.VARIANTS` → the capabilities by which a writer says that
its format cannot hold it."""
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")


class WriterConformance(Conformance):
    """What every writer must do. A subclass provides :meth:`writer`.

    The kit's dataset has five frames of a CubeSat, of which one does not show it; further ones differ
    in the camera, in joints and in a body beside the target.
    """

    @abstractmethod
    def writer(self) -> Writer[Any]:
        """A new writer, with the same options each time."""

    def images_in(self, folder: Path) -> Collection[str] | None:
        """The images that a reader of the format finds in an export, by their names in the dataset,
        ``images/NNNNNN.png``; None if there is no reader."""
        return None

    def test_every_file_is_among_its_paths(self) -> None:
        """It returns each file, or a folder that holds it: a dataset's manifest has the checksums of
        these alone."""
        with self._place() as place:
            paths = self._written(place)
            assert paths, "it returned no paths; is everything that it wrote left out of them?"
            for name in place.exported:
                file = place.export / name
                assert any(path == file or path in file.parents for path in paths), (
                    f"it wrote {name} and returned neither it nor a folder that holds it; 'posse"
                    " validate' could not find it damaged"
                )

    def test_it_can_be_read_back(self) -> None:
        """Every image of the dataset is in the export, if the subclass has a reader."""
        with self._place() as place:
            self._written(place)
            found = self.images_in(place.export)
            if found is None:
                return
            wanted = sorted(frame.image for frame in Dataset(place.dataset))
            assert sorted(found) == wanted, (
                f"the reader finds the images {sorted(found)}, and the dataset has {wanted}; are frames"
                " that do not show the spacecraft left out, or names changed?"
            )

    def test_the_same_dataset_gives_the_same_bytes(self) -> None:
        """From a new writer, and from one that wrote another dataset before."""
        used = self.writer()
        with self._place() as place:
            self._written(place)
            before = place.exported
        with self._place("a body beside the target") as place:
            used.write(Dataset(place.dataset), place.export)
        for what, writer in {"a new writer": self.writer(), "a writer that was used": used}.items():
            with self._place() as place:
                writer.write(Dataset(place.dataset), place.export)
                again = place.exported
            changed = sorted(name for name in before | again if before.get(name) != again.get(name))
            assert not changed, (
                f"{', '.join(changed)} from {what} differ from what was written before; does the time,"
                " an order of a set, a path of this machine or something of the last dataset go in?"
            )

    def test_nothing_names_this_machine(self) -> None:
        """Datasets and exports are moved: no absolute path of theirs is in a file."""
        with self._place() as place:
            self._written(place)
            for name, content in place.exported.items():
                assert str(place.root).encode() not in content, (
                    f"{name} has an absolute path of this machine; image paths are relative to the"
                    " dataset's folder, as in frame.image"
                )

    def test_names_of_files_are_safe(self) -> None:
        """On every system: letters, digits, ``_``, ``-`` and dots, and none that differ in
        case alone."""
        with self._place() as place:
            self._written(place)
            names = list(place.exported)
        for name in names:
            for part in Path(name).parts:
                assert _NAME.fullmatch(part), f"{name!r} has other characters than letters, digits, _-."
        lower = [name.lower() for name in names]
        twice = sorted({name for name in lower if lower.count(name) > 1})
        assert not twice, f"{twice[0]!r} is there twice where upper and lower case are the same"

    def test_it_writes_within_its_folder_alone(self) -> None:
        """The dataset stays as it is, to the byte, and nothing is written beside the folder or in the
        working directory."""
        with self._place() as place:
            before = place.elsewhere
            self._written(place)
            after = place.elsewhere
        changed = sorted(name for name in before | after if before.get(name) != after.get(name))
        assert not changed, (
            f"it wrote {', '.join(changed)}, which is not in the folder that it was given"
        )

    def test_an_error_ends_it(self) -> None:
        """What is raised while it reads the dataset reaches the caller, who then removes the folder; an
        export of half the dataset must not look like one of all."""
        with self._place() as place:
            self._written(place)
            whole = place.exported
        for error in (KeyboardInterrupt(), OSError("the disk cannot be read")):
            with self._place() as place:
                before = place.elsewhere
                try:
                    self.writer().write(_Torn(place.dataset, error), place.export)
                except type(error):
                    pass
                else:
                    assert place.exported == whole, (
                        f"{type(error).__name__} at the third frame was swallowed, and files of two"
                        " frames are left as if they were all"
                    )
                assert place.elsewhere == before, "files are left outside of the folder after an error"

    def test_labels_that_are_not_there(self) -> None:
        """A dataset with poses alone is written, or refused by an ``InputError`` that says what is
        missing."""
        refused = self._refusal("poses alone")
        if refused is not None:
            assert len(refused.splitlines()) == 1, f"the error is not one line: {refused}"
            assert "annotator" in refused, (
                f"the error {refused!r} does not name the annotator to add to the scenario"
            )

    def test_it_writes_what_its_capabilities_do_not_exclude(self) -> None:
        """Lenses, rolling shutters, joints and further bodies, unless a capability says that the format
        cannot hold them."""
        for variant, excluding in _NEEDS.items():
            if self.capabilities & excluding:
                continue
            refused = self._refusal(variant)
            words = " or ".join(map(repr, sorted(excluding))) or "no capability"
            assert refused is None, (
                f"it refuses a dataset with {variant} ({refused}); a run would end with that after all"
                f" frames are made. {words} would tell it before"
            )

    def test_it_needs_the_labels_alone(self) -> None:
        """Capability ``labels-only``: where images and arrays are not there, it writes the same."""
        if "labels-only" not in self.capabilities:
            return
        with self._place() as place:
            self._written(place)
            whole = place.exported
        with self._place() as place:
            shutil.rmtree(place.dataset / IMAGES)
            shutil.rmtree(place.dataset / TRUTH)
            try:
                self._written(place)
            except Exception as error:
                raise AssertionError(
                    f"without images and arrays it fails ({type(error).__name__}: {error}); leave out"
                    " the capability 'labels-only'"
                ) from None
            assert place.exported == whole, "without images and arrays it writes something else"

    def _refusal(self, variant: str) -> str | None:
        """Write a dataset; the message of the InputError that refuses it."""
        with self._place(variant) as place:
            try:
                self._written(place)
            except InputError as error:
                return str(error)
        return None

    def _written(self, place: _Place) -> list[Path]:
        made = self.writer().write(Dataset(place.dataset), place.export)
        return checked_paths(made, type(self.writer()).__name__, place.export)

    @contextlib.contextmanager
    def _place(self, variant: str = "plain") -> Iterator[_Place]:
        """A copy of a dataset and an empty folder to write to, in an empty working directory."""
        assert variant in VARIANTS, "there is no dataset of this name"
        before = Path.cwd()
        with tempfile.TemporaryDirectory(prefix="posse-writer-kit-") as root:
            place = _Place(Path(root).resolve())
            shutil.copytree(small_dataset(variant), place.dataset)
            place.export.mkdir(parents=True)
            (place.root / "working").mkdir()
            os.chdir(place.root / "working")
            try:
                yield place
            finally:
                os.chdir(before)


@dataclass(frozen=True)
class _Place:
    """A dataset, a folder to write to, and an empty working directory, in one folder."""

    root: Path

    @property
    def dataset(self) -> Path:
        return self.root / "dataset"

    @property
    def export(self) -> Path:
        return self.root / "exports" / "export"

    @property
    def exported(self) -> dict[str, bytes]:
        """Name → content of the files in the folder."""
        return _files(self.export)

    @property
    def elsewhere(self) -> dict[str, bytes]:
        """Name → content of all other files."""
        return {
            name: content
            for name, content in _files(self.root).items()
            if not name.startswith("exports/export/")
        }


def _files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


class _Torn(Dataset):
    """A dataset whose third frame cannot be read."""

    def __init__(self, folder: Path, error: BaseException) -> None:
        super().__init__(folder)
        self._error = error

    def _read(self, position: int, line: bytes) -> LabelLine:
        if position == 2:
            raise self._error
        return super()._read(position, line)
