"""The command line in forked processes, which need not import what the process they come from has."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import NoReturn

MOST_S = 60
"""The most processor time of a process, so that a machine with other work does not matter."""
_HANGS_S = 5 * MOST_S
"""After so long a command is taken to hang, whatever it waits for."""
MOST_BYTES = 2 << 30
_LIMIT_BYTES = 2 * MOST_BYTES
"""What a process cannot exceed. It is above what none may have, or a large allocation would fail and be
told as damage of the input."""


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Attributes:
        code: its exit code, or minus the signal that ended it.
        out: what it said.
        error: what it said on stderr.
        seconds: that it took.
        most_bytes: of memory that the largest of its processes had at once, beside what this one had.
        alive: names of the processes that it started and that went on after it; they are killed.
        temporary: names of the temporary files that it left.
    """

    code: int
    out: str
    error: str
    seconds: float
    most_bytes: int
    alive: Sequence[str]
    temporary: Sequence[str]


_KEPT = ("posse_core", "trimesh")
"""What of a command with an environment of its own is imported afterwards, with what that imports:
clients of network stores do not survive a fork."""


class Origin:
    """A process from which commands are forked, so that what it has imported they need not import.

    It is not this process, which may have drawn by OpenGL: one that has cannot be forked into another
    that draws.
    """

    def __init__(self) -> None:
        command = [sys.executable, __file__]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def run(self, folder: Path, arguments: Sequence[str], env: Mapping[str, str] | None = None) -> Ended:
        """Run a command in ``folder``.

        It is killed when it hangs. What it imports is imported afterwards in the process that it is
        forked from, of a command with an environment POSSE's own modules alone.

        Args:
            env: its environment. Without one it has that of this process, and limits: it is killed after
                a minute of processor time, and no process gets more than 4 GiB.
        """
        requests, answers = self._process.stdin, self._process.stdout
        assert requests is not None
        assert answers is not None
        request = [str(folder), list(arguments), None if env is None else dict(env)]
        requests.write(json.dumps(request).encode() + b"\n")
        requests.flush()
        return Ended(**json.loads(answers.readline()))

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def _serve() -> None:
    """Answer requests until there are no more."""
    for request in sys.stdin.buffer:
        folder, arguments, env = json.loads(request)
        ended, modules = _run(Path(folder), arguments, env)
        kept = [name for name in modules if env is None or name.partition(".")[0] in _KEPT]
        _import(kept)
        sys.stdout.buffer.write(json.dumps(asdict(ended)).encode() + b"\n")
        sys.stdout.buffer.flush()


def _run(
    folder: Path, arguments: Sequence[str], env: Mapping[str, str] | None
) -> tuple[Ended, list[str]]:
    """How a command ended, and the names of the modules that it imported."""
    (command,) = entry_points(group="console_scripts", name="posse")
    main = command.load()
    with contextlib.ExitStack() as stack:
        streams = [stack.enter_context(tempfile.TemporaryFile("w+b")) for _ in range(3)]
        temporary = stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
        # What the process has from the start is this one's.
        before = _resident_bytes()
        started = time.monotonic()
        process = os.fork()
        if not process:
            begin = partial(_limit, temporary) if env is None else partial(_take, env)
            _work(main, folder, arguments, [stream.fileno() for stream in streams], begin)
        code, usage = _awaited(process)
        seconds = time.monotonic() - started
        alive = _ended_group(process)
        left = tuple(sorted(path.name for path in Path(temporary).iterdir()))
        texts = []
        for stream in streams:
            stream.seek(0)
            texts.append(stream.read().decode(errors="replace"))
    most = max(0, usage.ru_maxrss * 1024 - before)
    return Ended(code, texts[0], texts[1], seconds, most, alive, left), texts[2].split()


def _import(modules: Sequence[str]) -> None:
    for name in modules:
        if name not in sys.modules:
            with contextlib.suppress(ImportError), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                importlib.import_module(name)


def _work(
    main: Callable[[list[str]], None],
    folder: Path,
    arguments: Sequence[str],
    streams: Sequence[int],
    begin: Callable[[], None],
) -> NoReturn:
    code: object = 99
    known = set(sys.modules)
    try:
        os.setpgid(0, 0)  # so that what it starts and leaves can be found
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(streams[0], 1)
        os.dup2(streams[1], 2)
        sys.stdout, sys.stderr = (open(k, "w", closefd=False) for k in (1, 2))  # noqa: SIM115
        os.chdir(folder)
        begin()
        main(list(arguments))
    except SystemExit as ended:
        code = ended.code
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os.write(streams[2], "\n".join(sorted(set(sys.modules) - known)).encode())
        os._exit(code if isinstance(code, int) else 99)


def _limit(temporary: str) -> None:
    """Limit this process, and give it a folder for temporary files."""
    os.environ.pop("POSSE_SHOW_FAULTS", None)
    os.environ["TMPDIR"] = tempfile.tempdir = temporary
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    bytes_ = pages * resource.getpagesize() + _LIMIT_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (bytes_, bytes_))
    resource.setrlimit(resource.RLIMIT_CPU, (MOST_S, MOST_S))
    warnings.simplefilter("default")  # as for users, who are told of them


def _take(env: Mapping[str, str]) -> None:
    """Take an environment in place of this process's own, as Python does when it starts."""
    os.environ.clear()
    os.environ.update(env)
    sys.path[:0] = [path for path in env.get("PYTHONPATH", "").split(os.pathsep) if path]


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def _awaited(process: int) -> tuple[int, resource.struct_rusage]:
    pipe = os.pidfd_open(process)
    try:
        if not select.select([pipe], [], [], _HANGS_S)[0]:
            os.kill(process, signal.SIGKILL)
        _, status, usage = os.wait4(process, 0)
        return os.waitstatus_to_exitcode(status), usage
    finally:
        os.close(pipe)


def _ended_group(group: int) -> tuple[str, ...]:
    """Names of the processes of a group that do not end within ten seconds; they are killed."""
    for _ in range(200):
        alive = _alive_in(group)
        if not alive:
            return ()
        time.sleep(0.05)
    os.killpg(group, signal.SIGKILL)
    return alive


def _alive_in(group: int) -> tuple[str, ...]:
    """Names of the processes of a group, without those that have ended and that nobody has waited for:
    the first process of a container may wait for none."""
    alive = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has ended since
            name, _, numbers = path.read_text().partition("(")[2].rpartition(") ")
            state, _, its_group = numbers.split()[:3]
            if int(its_group) == group and state not in "ZX":
                alive.append(name)
    return tuple(alive)


if __name__ == "__main__":
    _serve()
