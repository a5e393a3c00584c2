"""Finds the Mitsuba variant that works on this machine.

An unsuitable libLLVM (for example version 15 on an AVX-512 machine) does not raise an exception but
aborts the process. Each candidate therefore renders a tiny scene in a child process, and the result is
kept in the user's cache.
"""

from __future__ import annotations

import glob
import json
import os
import platform
import re
import subprocess
import sys
import zlib
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from posse_core import ComponentError, atomic_file

PROBE_TIMEOUT_S = 180.0
_LLVM_PATTERNS = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib64/llvm*/lib*/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    os.path.join(sys.prefix, "lib", "libLLVM*.so*"),
    os.path.expanduser("~/.rustup/toolchains/*/lib/libLLVM*.so*"),
)
_OF_A_COMPILER = re.compile(r"\brust|\bjulia")
"""In the path of a library that a compiler brings for itself. Such libraries are tried last: they are
built for that compiler and change with it."""
_NEWER = (
    "install a newer LLVM (Debian and Ubuntu: apt install libllvm19) or set DRJIT_LIBLLVM_PATH to one"
)


@dataclass(frozen=True)
class Choice:
    """The variant to set, the LLVM library that it needs, and why no faster variant was chosen."""

    variant: str
    library: str = ""
    note: str = ""


def choose(wanted: str) -> Choice:
    """Choose the variant for the option value ``auto``, ``llvm``, ``scalar`` or ``cuda``.

    Raises:
        ComponentError: the variant that the user asked for does not work on this machine, with the
            causes.
    """
    if wanted == "scalar":
        return Choice("scalar_rgb")
    if wanted == "cuda":
        cause = _probe("cuda_ad_rgb", "")
        if cause:
            raise ComponentError(
                f"renderer.variant: cuda does not work on this machine: {cause}; it needs an NVIDIA GPU"
                " and driver; use -o renderer.variant=auto"
            )
        return Choice("cuda_ad_rgb")
    failures = []
    for library in llvm_candidates():
        cause = _remembered_probe(library)
        if not cause:
            return Choice("llvm_ad_rgb", library)
        failures.append(f"{library}: {cause}")
    causes = "; ".join(failures) or "no libLLVM was found"
    if wanted == "llvm":
        raise ComponentError(
            f"renderer.variant: llvm does not work on this machine: {causes}; {_NEWER},"
            " or use -o renderer.variant=scalar"
        )
    return Choice("scalar_rgb", note=f"llvm would be faster but does not work: {causes}; {_NEWER}")


def load_library(library: str) -> None:
    """Make Mitsuba load this libLLVM. Mitsuba loads its libLLVM when it is imported.

    Raises:
        ComponentError: Mitsuba has already been imported in this process, with another libLLVM.
    """
    if "drjit" in sys.modules and os.environ.get("DRJIT_LIBLLVM_PATH") != library:
        raise ComponentError(
            "mitsuba has already been imported in this process with another libLLVM than the one that"
            f" works; set DRJIT_LIBLLVM_PATH={library} before starting Python"
        )
    os.environ["DRJIT_LIBLLVM_PATH"] = library


def llvm_candidates() -> list[str]:
    """The LLVM libraries to try: the system's, newest first, and then those that compilers bring for
    themselves; only the one in DRJIT_LIBLLVM_PATH if that is set."""
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    if named:
        return [named]
    found = {os.path.realpath(path) for pattern in _LLVM_PATTERNS for path in glob.glob(pattern)}
    return sorted(filter(_version, found), key=_rank, reverse=True)


def _rank(path: str) -> tuple[bool, tuple[int, ...], str]:
    """By which libraries are ordered, the best one last."""
    return not _OF_A_COMPILER.search(path), _version(path), path


def _version(path: str) -> tuple[int, ...]:
    match = re.search(r"libLLVM(?:-|\.so\.|\.)(\d+(?:\.\d+)*)", os.path.basename(path))
    return tuple(int(part) for part in match[1].split(".")) if match else ()


def _remembered_probe(library: str) -> str:
    """As :func:`_probe` of the llvm variant, but cached per library, Mitsuba version and processor."""
    try:
        modified = os.stat(library).st_mtime_ns
    except OSError as error:
        return f"{error.strerror}"
    mitsuba = metadata.version("mitsuba")
    key = f"{library} {modified} mitsuba {mitsuba} {platform.machine()} {_processor()}"
    cache = _cache_file()
    known: dict[str, str] = {}
    with suppress(OSError, ValueError):
        known = json.loads(cache.read_text(encoding="utf-8"))
    if key not in known:
        try:
            cause = _probe("llvm_ad_rgb", library)
        except subprocess.TimeoutExpired:  # the machine may only be busy, so this is not cached
            return f"no answer in {PROBE_TIMEOUT_S:.0f} s"
        known[key] = cause
        with suppress(OSError):  # if the cache cannot be written, the next run probes again
            cache.parent.mkdir(parents=True, exist_ok=True)
            with atomic_file(cache) as file:
                file.write(json.dumps(known, indent=2).encode())
    return known[key]


def _cache_file() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "posse" / "mitsuba-llvm.json"


def _processor() -> str:
    """A digest of the processor's instruction sets: machines that differ may share a home folder."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith(("flags", "Features")):
                return f"{zlib.crc32(line.encode()):08x}"
    return platform.processor()


def _probe(variant: str, library: str) -> str:
    """Render in a child process.

    Returns:
        Why the variant does not work, or an empty string if it works.
    """
    environment = dict(os.environ)
    if library:
        environment["DRJIT_LIBLLVM_PATH"] = library
    child = subprocess.run(
        [sys.executable, "-P", "-m", "posse_render_mitsuba.probe", variant],
        env=environment,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=PROBE_TIMEOUT_S,
        check=False,
    )
    if child.returncode == 0 and child.stdout.strip().endswith("usable"):
        return ""
    lines = [line.strip() for line in child.stderr.splitlines() if line.strip()]
    if child.returncode < 0:
        reason = next((line for line in lines if "LLVM ERROR" in line), "")
        return f"it ends the process with signal {-child.returncode}" + (
            f" ({reason})" if reason else ""
        )
    return lines[-1] if lines else f"exit code {child.returncode}"
