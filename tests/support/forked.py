"""The command line in a forked process, with limits of time and memory."""

from __future__ import annotations

import os
import resource
import select
import signal
import sys
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

MOST_S = 60
MOST_BYTES = 2 << 30


@dataclass(frozen=True)
class Ended:
    """How a command ended: its exit code, or minus the signal that ended it; and what it said."""

    code: int
    out: str
    error: str


def run_forked(folder: Path, arguments: Sequence[str]) -> Ended:
    """Run a command in ``folder``; after a minute it is killed, and it gets no more than 2 GiB.

    The process is forked, so what this one has imported need not be imported again.
    """
    (command,) = entry_points(group="console_scripts", name="posse")
    main = command.load()
    with tempfile.TemporaryFile("w+b") as out, tempfile.TemporaryFile("w+b") as error:
        process = os.fork()
        if not process:
            _work(main, folder, arguments, out.fileno(), error.fileno())
        code = _awaited(process)
        texts = []
        for stream in (out, error):
            stream.seek(0)
            texts.append(stream.read().decode(errors="replace"))
    return Ended(code, *texts)


def _work(main, folder: Path, arguments: Sequence[str], out: int, error: int) -> None:
    code: object = 99
    try:
        os.dup2(out, 1)
        os.dup2(error, 2)
        sys.stdout, sys.stderr = (open(k, "w", closefd=False) for k in (1, 2))  # noqa: SIM115
        os.chdir(folder)
        os.environ.pop("POSSE_SHOW_FAULTS", None)
        tempfile.tempdir = str(folder.parent)  # where the details of a fault are written
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        bytes_ = pages * resource.getpagesize() + MOST_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (bytes_, bytes_))
        warnings.simplefilter("default")  # as for users, who are told of them
        main(list(arguments))
    except SystemExit as ended:
        code = ended.code
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 99)


def _awaited(process: int) -> int:
    pipe = os.pidfd_open(process)
    try:
        if not select.select([pipe], [], [], MOST_S)[0]:
            os.kill(process, signal.SIGKILL)
        return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    finally:
        os.close(pipe)
