"""Choosing a variant with a library that aborts the process, a file that is no library, and no
library."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from posse_core import ComponentError
from posse_render_mitsuba import variants
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.renderer import MitsubaRenderer


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def not_a_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "libLLVM.so.99"
    path.write_text("this is no library")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(path))
    return path


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Replace the probe's child process by a shell script, which notes each start in a file."""

    def child(body: str) -> Path:
        notes, script = tmp_path / "notes", tmp_path / "python"
        script.write_text(f"#!/bin/sh\necho $DRJIT_LIBLLVM_PATH >> {notes}\n{body}\n")
        script.chmod(0o755)
        monkeypatch.setattr(sys, "executable", str(script))
        return notes

    return child


def test_asking_for_llvm_that_does_not_work_is_an_error_with_cause_and_way_out(
    not_a_library: Path,
) -> None:
    with pytest.raises(ComponentError) as raised:
        variants.choose("llvm")
    message = str(raised.value)
    assert str(not_a_library) in message
    assert "renderer.variant=scalar" in message
    assert "\n" not in message


def test_auto_falls_back_to_scalar_and_says_why(not_a_library: Path) -> None:
    choice = variants.choose("auto")
    assert choice.variant == "scalar_rgb"
    assert str(not_a_library) in choice.note


def test_doctor_names_the_variant_and_the_way_to_a_faster_one(not_a_library: Path) -> None:
    findings = {what: (ok, text) for what, ok, text in MitsubaRenderer.doctor(MitsubaOptions())}
    works, detail = findings["variant"]
    assert works
    assert "scalar_rgb" in detail
    assert "libllvm19" in detail
    _, works, detail = MitsubaRenderer.doctor(MitsubaOptions(variant="llvm"))[1]
    assert not works
    assert "libllvm19" in detail


def test_a_missing_library_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "gone.so"))
    assert "No such file" in variants.choose("auto").note


def test_a_library_that_aborts_ends_the_child_process_only(not_a_library: Path, child) -> None:
    child("echo 'LLVM ERROR: Cannot select: fminimum' >&2\nkill -ABRT $$")
    choice = variants.choose("auto")
    assert choice.variant == "scalar_rgb"
    assert "signal 6" in choice.note
    assert "Cannot select" in choice.note


def test_a_child_that_hangs_is_given_up_and_not_cached(
    not_a_library: Path, child, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes = child("sleep 5")
    monkeypatch.setattr(variants, "PROBE_TIMEOUT_S", 0.2)
    for _ in range(2):
        assert "no answer" in variants.choose("auto").note
    assert len(notes.read_text().splitlines()) == 2


def test_the_result_is_cached_until_the_library_changes(not_a_library: Path, child) -> None:
    notes = child("echo usable")
    for _ in range(3):
        assert variants.choose("llvm") == variants.Choice("llvm_ad_rgb", str(not_a_library))
    assert len(notes.read_text().splitlines()) == 1
    os.utime(not_a_library, ns=(1, 1))
    variants.choose("llvm")
    assert len(notes.read_text().splitlines()) == 2


def test_the_newest_library_that_works_is_chosen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, child
) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    for name in ("libLLVM-9.so.1", "libLLVM.so.19.1", "libLLVM-20.so", "libLLVMFoo.so"):
        (tmp_path / name).write_text(name)
    monkeypatch.setattr(variants, "_LLVM_PATTERNS", (f"{tmp_path}/libLLVM*.so*",))
    notes = child("case $DRJIT_LIBLLVM_PATH in *-20.so) exit 1;; *) echo usable;; esac")
    assert variants.choose("auto").library == str(tmp_path / "libLLVM.so.19.1")
    tried = [Path(line).name for line in notes.read_text().splitlines()]
    assert tried == ["libLLVM-20.so", "libLLVM.so.19.1"]


def test_a_compilers_own_library_is_tried_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, child
) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    names = (
        ".rustup/toolchains/stable/lib/libLLVM.so.22.1-rust-1.95.0-stable",
        "julia/libLLVM-18jl.so",
        "llvm-14/lib/libLLVM-14.so.1",
        "llvm-19/lib/libLLVM-19.so.1",
    )
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(name)
    monkeypatch.setattr(variants, "_LLVM_PATTERNS", tuple(str(tmp_path / name) for name in names))
    notes = child("exit 1")
    variants.choose("auto")
    tried = [Path(line).name for line in notes.read_text().splitlines()]
    assert tried == [Path(name).name for name in (names[3], names[2], names[0], names[1])]


def test_cuda_without_a_gpu_is_an_error() -> None:
    if Path("/dev/nvidiactl").exists():
        pytest.skip("there is a GPU")
    with pytest.raises(ComponentError, match="cuda does not work on this machine"):
        variants.choose("cuda")


def test_another_library_is_refused_once_mitsuba_is_imported() -> None:
    code = """
import mitsuba
from posse_core import ComponentError
from posse_render_mitsuba.variants import load_library
try:
    load_library("/another/libLLVM.so")
except ComponentError as error:
    print(error)
"""
    environment = {k: v for k, v in os.environ.items() if k != "DRJIT_LIBLLVM_PATH"}
    printed = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    ).stdout
    assert "set DRJIT_LIBLLVM_PATH=/another/libLLVM.so before starting Python" in printed
