"""Records the labels of the built-in scenarios: ``built_in_labels.json``, beside this file.

It was run with the code of the release before, so that it says what those scenarios gave then; run it
again only for a change of labels that is meant.
"""

from __future__ import annotations

import hashlib
import json
import platform
from pathlib import Path

import numpy as np

RECORD = Path(__file__).with_name("built_in_labels.json")
SCENARIOS = ("aqua", "cluster", "posse-v1", "posse-v2", "posse-aqua-earth", "posse-cluster-earth")
"""Every built-in scenario that is not a collection of these."""
FRAMES = 3


def label_lines(dataset: Path) -> list[str]:
    """Lines of the only shard of a dataset."""
    return (dataset / "labels" / "shard-00000.jsonl").read_text(encoding="utf-8").splitlines()


def array_digests(dataset: Path) -> dict[str, str]:
    """``FRAME/NAME`` → SHA-256 of the bytes of an array, apart from how the file packs them."""
    digests = {}
    for path in sorted((dataset / "truth").glob("*.npz")):
        with np.load(path, allow_pickle=False) as arrays:
            for name in sorted(arrays):
                digest = hashlib.sha256(f"{arrays[name].dtype} {arrays[name].shape}".encode())
                digest.update(np.ascontiguousarray(arrays[name]).tobytes())
                digests[f"{path.stem}/{name}"] = digest.hexdigest()
    return digests


def arithmetic() -> str:
    """A digest of how this machine rounds: its last digits depend on the processor's instructions.

    Two processors whose digits below agree have given a pixel on an edge to different parts, so the
    processor's name counts too. What in them differs is not known.
    """
    x = np.linspace(-3.0, 3.0, 1001)
    matrix = np.outer(np.sin(x[:9]), np.cos(x[:9]))
    parts = [np.sin(x), np.cos(x), np.exp(x), np.arctan2(x, x[::-1]), matrix @ matrix]
    numbers = b"".join(part.tobytes() for part in parts)
    return hashlib.sha256(numbers + processor().encode()).hexdigest()


def processor() -> str:
    """What this machine's processor is called."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text(encoding="utf-8").splitlines() if about.is_file() else []
    return next((line for line in lines if line.startswith("model name")), platform.processor())


def record(datasets: Path) -> None:
    """Write the record from a folder that holds a dataset of each scenario, by its name."""
    labels = {
        name: {"lines": label_lines(datasets / name), "arrays": array_digests(datasets / name)}
        for name in SCENARIOS
    }
    value = {"arithmetic": arithmetic(), "labels": labels}
    RECORD.write_text(json.dumps(value, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    import subprocess
    import sys
    import tempfile

    posse = str(Path(sys.executable).with_name("posse"))
    with tempfile.TemporaryDirectory() as folder:
        for scenario in SCENARIOS:
            out = ["--frames", str(FRAMES), "--out", f"{folder}/{scenario}"]
            subprocess.run([posse, "run", scenario, *out], check=True)
        record(Path(folder))
