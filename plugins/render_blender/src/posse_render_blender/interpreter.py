"""Finds the program that runs Cycles: a Python that has bpy, or a blender executable."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from posse_core import ComponentError
from posse_render_blender.options import BlenderOptions

WORKER = Path(__file__).parent / "worker" / "main.py"
WAY_OUT = (
    "make a Python with bpy (python3.11 -m venv bpy && bpy/bin/pip install 'bpy==5.0.1' 'numpy<2')"
    " and give its path by -o renderer.python=PATH or POSSE_BLENDER_PYTHON, or give the path of a"
    " Blender 4.5 or later by -o renderer.executable=PATH or POSSE_BLENDER"
)


@dataclass(frozen=True)
class Interpreter:
    """A program that can run the worker.

    Attributes:
        path: absolute path of the program.
        is_blender: whether it is a blender executable rather than a Python.
        source: the option or environment variable that names it, for messages.
    """

    path: str
    is_blender: bool
    source: str

    def __str__(self) -> str:
        return f"{self.path} (from {self.source})"

    def command(self, requests_fd: int, answers_fd: int, folder: Path) -> list[str]:
        """The command line that starts the worker with two inherited file descriptors and its folder."""
        arguments = [str(requests_fd), str(answers_fd), str(folder)]
        if self.is_blender:
            blender = [self.path, "--background", "--factory-startup", "-noaudio"]
            return [*blender, "--python-exit-code", "1", "--python", str(WORKER), "--", *arguments]
        return [self.path, str(WORKER), *arguments]

    def environment(self, environ: Mapping[str, str], folder: Path) -> dict[str, str]:
        """Environment variables of the worker, which put its files into ``folder`` and remove the paths
        of POSSE's Python if the worker runs under another one."""
        out = dict(environ)
        if self.path != sys.executable:
            for name in ("PYTHONHOME", "PYTHONPATH"):
                out.pop(name, None)
        # The user's preferences and add-ons would change the images.
        out.update(TMPDIR=str(folder), BLENDER_USER_RESOURCES=str(folder), PYTHONUNBUFFERED="1")
        return out


def find_interpreter(options: BlenderOptions, environ: Mapping[str, str] = os.environ) -> Interpreter:
    """The interpreter named by an option, else by an environment variable, else the Python that runs
    POSSE.

    Raises:
        ComponentError: the name is not that of an executable file.
    """
    named = [
        (options.python, False, "renderer.python"),
        (options.executable, True, "renderer.executable"),
        (environ.get("POSSE_BLENDER_PYTHON"), False, "POSSE_BLENDER_PYTHON"),
        (environ.get("POSSE_BLENDER"), True, "POSSE_BLENDER"),
        (sys.executable, False, "the Python that runs POSSE"),
    ]
    path, is_blender, source = next(entry for entry in named if entry[0])
    found = shutil.which(Path(str(path)).expanduser())
    if found is None:
        raise ComponentError(f"blender: {source} names {path!r}, which is not a program; {WAY_OUT}")
    return Interpreter(os.path.abspath(found), is_blender, source)
