"""Digests of the files that writers exported, by which they are checked later."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from posse_core._dataset.layout import MANIFEST
from posse_core._files.atomic import sha256, write_json
from posse_core._model.manifest import Manifest


def export_digests(paths: Iterable[Path], folder: Path) -> dict[str, str]:
    """Return the SHA-256 of all files that ``paths`` are or contain, by their names in ``folder``."""
    home = folder.resolve()
    files = {
        file.resolve().relative_to(home).as_posix(): file
        for path in paths
        for file in (path.rglob("*") if path.is_dir() else (path,))
        if file.is_file() and not file.is_symlink()
    }
    return {name: sha256(files[name]) for name in sorted(files)}


def record_exports(folder: Path, paths: Sequence[Path]) -> None:
    """Record the files that a writer wrote into a finished dataset in the dataset's manifest.

    Digests that were recorded before for the same files and folders are replaced.
    """
    replaced = [path.resolve().relative_to(folder.resolve()) for path in paths]
    manifest = Manifest.from_json((folder / MANIFEST).read_bytes())
    kept = {
        name: digest
        for name, digest in manifest.exports.items()
        if not any(Path(name).is_relative_to(path) for path in replaced)
    }
    recorded = dict(sorted({**kept, **export_digests(paths, folder)}.items()))
    changed = manifest.model_copy(update={"exports": recorded})
    write_json(folder / MANIFEST, changed.as_json())
