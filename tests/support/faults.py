"""Runs that come to grief in many ways, one after another, and are resumed: by seed, many times.

``python -c "from faults import main; main()" SCENARIO FOLDER ROUNDS SEED [URL]``

A round is a dataset. Runs on it meet a fault each, in an order drawn by the seed, so that two rounds
have met them all; the last run meets none, and must leave every file equal to the bit to those of a
run that met none at all. With URL the dataset lies in a network store, whose server refuses writes
while the file FOLDER/refusing exists.
Runs are forked from this process, which has planned once; their workers are spawned, as always.
"""

import json
import os
import random
import resource
import shutil
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import fsspec
from faulty_worker import FaultyWorker

from posse_core._errors import PosseError
from posse_core._plugins.loading import load_plugins
from posse_core._run import destination, lease, shards
from posse_core._run.attempts import PoolOptions
from posse_core._run.local import LocalExecutor
from posse_core._run.plan import Plan, make_plan
from posse_core._run.run import run
from posse_core._scenario.load import load_scenario

FRAMES = 40
shards.FRAMES_PER_SHARD = 16
destination.JOURNAL_EVERY_S = 0.1
lease.RENEW_S, lease.PATIENCE_S = 0.2, 3.0


class Executor(LocalExecutor):
    """The pool of every run, with faulty workers."""

    def __init__(self, out: str, faults: dict[int, str], marks: Path, limit_s: float) -> None:
        super().__init__(PoolOptions(workers=2, frames_per_worker=15, frame_time_limit_s=limit_s))
        self._make = partial(FaultyWorker, out, faults, marks)

    def run(self, make_worker, indices):
        return super().run(self._make, indices)


class Round:
    """One dataset and what befalls it."""

    def __init__(self, plan: Plan, folder: Path, out: str, draw: random.Random) -> None:
        self._plan = plan
        self._folder = folder
        self._out = out
        self._draw = draw
        self._attempt = 0
        folder.mkdir()

    def start(self, faults: dict[int, str] | None = None, limit_s: float = 1800, bytes_: int = 0) -> int:
        """Fork a run; its process id. It exits with the command line's code, or 99 with a trace."""
        self._attempt += 1
        marks = self._folder / f"marks-{self._attempt}"
        marks.mkdir()

        def work() -> int:
            if bytes_:
                resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_, resource.RLIM_INFINITY))
            executor = Executor(self._out, faults or {}, marks, limit_s)
            done = run(
                *(self._plan, self._out, load_plugins(), executor),
                resume=True,
                progress=lambda results, *_: results,
            )
            return 3 if done.failed else 0

        return fork(work, self._folder / f"said-{self._attempt}")

    def end(self, process: int, *codes: int) -> None:
        """Wait for a run to end with one of these codes."""
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        said = "\n".join(path.read_text() for path in self._folder.glob("said-*"))
        assert code in codes, f"exit code {code}, not {codes}:\n{said}"

    def workers_die(self) -> None:
        kinds = [f"killed at {stage}" for stage in (0, 1, 2)]
        frames = self._draw.sample(range(FRAMES), self._draw.randint(1, 4))
        self.end(self.start({frame: self._draw.choice(kinds) for frame in frames}), 0)

    def renderer_hangs(self) -> None:
        fault = {self._draw.randrange(FRAMES): f"hung at {self._draw.randrange(3)}"}
        self.end(self.start(fault, limit_s=6), 0, 3)

    def run_is_killed(self) -> None:
        process = self.start()
        time.sleep(self._draw.uniform(0, 4))
        os.kill(process, signal.SIGKILL)
        self.end(process, 0, -signal.SIGKILL)

    def disk_is_full(self) -> None:
        self.end(self.start(bytes_=self._draw.randint(3000, 12000)), 0, 2, 3)

    def two_at_once(self) -> None:
        first = self.start()
        time.sleep(self._draw.uniform(0, 1))
        second = self.start()
        self.end(first, 0, 2)
        self.end(second, 0, 2)

    def files_are_damaged(self) -> None:
        self.end(self.start(), 0)
        paths = [
            path
            for part in ("images/*", "truth/*", "labels/*", "*.sha256")
            for path in Path(self._out).glob(part)
            if path.stat().st_size
        ]
        for path in self._draw.sample(paths, min(len(paths), self._draw.randint(1, 5))):
            data = bytearray(path.read_bytes())
            at = self._draw.randrange(len(data))
            match self._draw.choice(["flip", "cut", "lose", "grow"]):
                case "flip":
                    data[at] ^= 1 << self._draw.randrange(8)
                case "cut":
                    del data[at:]
                case "grow":
                    data += data[at:]
                case "lose":
                    path.unlink()
                    continue
            path.write_bytes(data)

    def store_refuses(self) -> None:
        refusing = self._folder.parent / "refusing"
        process = self.start()
        time.sleep(self._draw.uniform(0, 4))
        refusing.touch()
        time.sleep(self._draw.uniform(0.1, 3))
        refusing.unlink()
        self.end(process, 0, 3)


def fork(work: Callable[[], int], said: Path) -> int:
    process = os.fork()
    if process:
        return process
    code = 99
    try:
        code = work()
    except PosseError as error:
        said.write_text(f"{error}\n")
        code = error.exit_code if len(str(error).splitlines()) == 1 else 99
    except BaseException:
        said.write_text(traceback.format_exc())
    os._exit(code)


LOCAL = (
    "workers_die",
    "renderer_hangs",
    "run_is_killed",
    "disk_is_full",
    "two_at_once",
    "files_are_damaged",
)
REMOTE = ("workers_die", "run_is_killed", "two_at_once", "store_refuses")


def row_of_faults(names: tuple[str, ...], seed: str, number: int) -> list[str]:
    """One half of the faults in an even round, the other half in the odd one after it."""
    order = random.Random(f"{seed} {number // 2} order").sample(names, len(names))
    half = len(names) // 2
    return order[half:] if number % 2 else order[:half]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def fetch(url: str, folder: Path) -> int:
    files, root = fsspec.url_to_fs(url, use_listings_cache=False)
    for path in files.find(root):
        target = folder / path.removeprefix(f"{root}/")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(files.cat_file(path))
    files.rm(root, recursive=True)
    return 0


def main() -> None:
    """Prints how often each fault was met; fails with the round and its faults named."""
    scenario, base_folder, rounds, seed, *url = sys.argv[1:]
    registry = load_plugins().registry
    changes = {"times.count": FRAMES, "writers": ["speed"]}
    plan = make_plan(load_scenario(scenario, registry, changes), registry)
    base = Path(base_folder)
    whole = Round(plan, base / "whole", str(base / "whole" / "dataset"), random.Random())
    whole.end(whole.start(), 0)
    expected = contents(base / "whole" / "dataset")
    assert json.loads(expected["manifest.json"])["state"] == "complete"
    met: Counter[str] = Counter()
    for number in range(int(rounds)):
        draw = random.Random(f"{seed} {number}")
        folder = base / f"round-{number}"
        out = f"{url[0]}/{number}" if url else str(folder / "dataset")
        faults = row_of_faults(REMOTE if url else LOCAL, seed, number)
        try:
            round_ = Round(plan, folder, out, draw)
            for fault in faults:
                getattr(round_, fault)()
            round_.end(round_.start(), 0)
            if url:
                copied = fork(partial(fetch, out, folder / "dataset"), folder / "said-copy")
                round_.end(copied, 0)
            found = contents(folder / "dataset")
            other = sorted(n for n in {*found, *expected} if found.get(n) != expected.get(n))
            assert not other, f"not as in an undisturbed run: {', '.join(other)}"
        except AssertionError as error:
            sys.exit(f"seed {seed}, round {number}, {', '.join(faults)}: {error}")
        met.update(faults)
        shutil.rmtree(folder)
    print(json.dumps(met))


if __name__ == "__main__":
    main()
