"""Copies of the files that a scenario names, which make its dataset complete (``inputs/``)."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from posse_core._dataset.layout import INPUTS, SCENARIO, inside
from posse_core._errors import InputError
from posse_core._files.atomic import atomic_file, remove_partial, sha256
from posse_core._files.reading import MISSING, MOST_BYTES, check_file
from posse_core._plugins.registry import Registry
from posse_core._scenario.files import is_within, with_files
from posse_core._scenario.load import load_scenario
from posse_core._scenario.model import Scenario
from posse_core._scenario.yaml_lines import KeyPath
from posse_core._spacecraft.files import mesh_files
from posse_core._spacecraft.package import DESCRIPTION, package_files

MOST_INPUTS: Final = 10_000
"""The most files that are copied for one scenario; together they have at most :data:`MOST_BYTES`."""


@dataclass(frozen=True)
class Inputs:
    """A scenario as its dataset has it.

    Attributes:
        scenario: its paths are relative to the dataset's folder.
        files: name in the dataset → the file that is copied there.
    """

    scenario: Scenario
    files: Mapping[str, Path] = field(default_factory=dict)


def inputs_of(scenario: Scenario) -> Inputs:
    """Give the files of a scenario their names in its dataset.

    The name begins with the keys that name the file, as in ``inputs/propagator.path/flown.csv``. That of
    a file which has such a name already stays the same.

    Args:
        scenario: with absolute paths.

    Raises:
        InputError: a file is missing, cannot be read, or is too large.
    """
    files: dict[str, Path] = {}

    def name(key: KeyPath, path: Path) -> Path:
        keys = ".".join(map(str, key))
        folder = f"{INPUTS}/{keys}"
        try:
            files.update({f"{folder}/{own}": source for own, source in _files_at(path).items()})
        except InputError as error:
            raise InputError(f"{keys}: {error}") from None
        return Path(folder if path.is_dir() else f"{folder}/{path.name}")

    named = with_files(scenario, name)
    total = sum(source.stat().st_size for source in files.values())
    if len(files) > MOST_INPUTS or total > MOST_BYTES:
        raise InputError(
            f"the scenario names {len(files)} files of {total / 2**30:.1f} GiB, and a dataset has copies"
            f" of at most {MOST_INPUTS} of {MOST_BYTES >> 30} GiB; name folders that hold only what is"
            " needed"
        )
    return Inputs(named, files)


def _files_at(path: Path) -> dict[str, Path]:
    """What is needed of a file or folder: path from its folder, or from it → file."""
    if not path.is_dir():
        check_file(path, MISSING)
        found = mesh_files(path)
    elif (path / DESCRIPTION).exists():
        found = package_files(path)
    else:
        found = _folder_files(path)
    for each in found.values():
        check_file(each)
    return found


def _folder_files(folder: Path) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for above, _, names in os.walk(folder):
        for path in (Path(above) / name for name in sorted(names)):
            if not is_within(path, folder):
                raise InputError(f"{path}: leads out of its folder by a link; put the file there")
            found[path.relative_to(folder).as_posix()] = path
        if len(found) > MOST_INPUTS:
            break  # its number is refused
    return found


def as_begun(folder: Path, scenario: Scenario, inputs: Inputs, registry: Registry, out: str) -> Inputs:
    """Check that a folder was begun with a scenario, and return the scenario as it was begun.

    Args:
        folder: with the file of the scenario, which may lack keys that earlier versions did not have.
        scenario: with absolute paths.
        inputs: of it.
        registry: the components that are installed.
        out: the folder's location, for messages.

    Raises:
        InputError: the folder has another scenario.
    """
    home = folder.absolute()

    def named(key: KeyPath, path: Path) -> Path:
        return path.relative_to(home) if path.is_relative_to(home / INPUTS) else path

    begun = with_files(load_scenario(str(home / SCENARIO), registry), named)
    # Earlier versions did not copy files: the scenarios of their datasets have absolute paths.
    for known in (inputs, Inputs(scenario)):
        if begun == known.scenario:
            return known
    raise InputError(
        f"--out {out}: what is there has another scenario than this one; resume it without"
        " a scenario or options, or choose another folder"
    )


def write_inputs(folder: Path, inputs: Inputs, recorded: Mapping[str, str]) -> None:
    """Copy files into the dataset, where an earlier attempt has not.

    Args:
        folder: of the dataset.
        inputs: its scenario and files.
        recorded: name → digest of files as an earlier attempt that has ended wrote them.

    Raises:
        InputError: a file differs from what an earlier attempt had there.
    """
    for name, source in inputs.files.items():
        target = inside(folder, name)
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_partial(target.parent)
        there = sha256(target) if target.is_file() else None
        first = recorded.get(name)
        if first is None and target.exists() and target.samefile(source):
            continue
        wanted = sha256(source)
        if (first or there or wanted) != wanted:
            raise InputError(
                f"{source}: is not the file {name} that the run in {folder} was begun with; restore it"
                " from a copy, or choose another folder"
            )
        if there != wanted:
            with atomic_file(target) as stream, source.open("rb") as original:
                shutil.copyfileobj(original, stream)
