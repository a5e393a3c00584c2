"""A dataset in other formats: what its writers wrote, and the digests by which it is checked later."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from posse_core._dataset.layout import MANIFEST
from posse_core._files.atomic import sha256, write_json
from posse_core._model.manifest import Manifest


def export_digests(paths: Iterable[Path], folder: Path) -> dict[str, str]:
    """File, relative to ``folder`` → its SHA-256, of all files that ``paths`` are or hold."""
    home = folder.resolve()
    files = {
        file.resolve().relative_to(home).as_posix(): file
        for path in paths
        for file in (path.rglob("*") if path.is_dir() else (path,))
        if file.is_file() and not file.is_symlink()
    }
    return {name: sha256(files[name]) for name in sorted(files)}


def enter_exports(folder: Path, paths: Sequence[Path]) -> None:
    """Enter what a writer wrote in the folder of a finished dataset in the dataset's manifest.

    What was entered before of the same files and folders is replaced.
    """
    replaced = [path.resolve().relative_to(folder.resolve()) for path in paths]
    manifest = Manifest.from_json((folder / MANIFEST).read_bytes())
    kept = {
        name: digest
        for name, digest in manifest.exports.items()
        if not any(Path(name).is_relative_to(path) for path in replaced)
    }
    entered = dict(sorted({**kept, **export_digests(paths, folder)}.items()))
    changed = manifest.model_copy(update={"exports": entered})
    write_json(folder / MANIFEST, changed.as_json())
