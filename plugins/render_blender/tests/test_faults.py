"""Whatever is missing, wrong or dies is reported in one line that says what to do."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from posse_core import ComponentError, Material, PixelBox, RenderRequest, Scene, WorkerLost
from posse_core.testing import scenes
from posse_render_blender import child
from posse_render_blender.interpreter import find_interpreter
from posse_render_blender.options import BlenderOptions
from posse_render_blender.renderer import BlenderRenderer

BOX = PixelBox(0, 0, 32, 24)
ENDLESS_SPP = 2**20


def plate() -> Scene:
    camera = scenes.camera(32, 24)
    return scenes.scene(
        scenes.rectangle("plate", "white"), materials=(Material("white"),), camera=camera
    )


def request() -> RenderRequest:
    frame = scenes.frame(t_body_cam_m=(0, 0, 4), sun_direction_body=(0, 0, 1))
    return RenderRequest(frame.craft, BOX, None, seed=1)


def failure(options: BlenderOptions) -> str:
    """The message with which opening fails, checked to be one line."""
    with pytest.raises(ComponentError) as caught:
        BlenderRenderer(options).open(plate())
    message = str(caught.value)
    assert message.startswith("blender: ")
    assert "\n" not in message
    assert BlenderRenderer.doctor(options)[-1][1] is False
    return message


def program(path: Path, text: str) -> str:
    path.write_text("#!/bin/sh\n" + text)
    path.chmod(0o755)
    return str(path)


def python_with(path: Path, prelude: str) -> str:
    """A Python that runs ``prelude`` before its script."""
    code = f"import runpy, sys, types; {prelude}; sys.argv = sys.argv[1:]; "
    code += "runpy.run_path(sys.argv[0], run_name='__main__')"
    return program(path, f'exec {shlex.quote(sys.executable)} -c {shlex.quote(code)} "$@"\n')


def test_a_program_that_does_not_exist() -> None:
    message = failure(BlenderOptions(python="/nowhere/python3.11"))
    assert "renderer.python names '/nowhere/python3.11', which is not a program" in message
    assert "POSSE_BLENDER_PYTHON" in message


def test_a_file_that_cannot_be_executed(tmp_path: Path) -> None:
    path = tmp_path / "blender"
    path.write_text("not a program")
    assert "which is not a program" in failure(BlenderOptions(executable=str(path)))
    path.chmod(0o755)
    assert "cannot be started: Exec format error" in failure(BlenderOptions(executable=str(path)))


def test_a_program_that_is_not_blender(tmp_path: Path) -> None:
    path = program(tmp_path / "blender", "echo usage: something else; exit 2\n")
    message = failure(BlenderOptions(executable=path))
    assert "is not a Blender" in message
    assert "exit code 2" in message
    assert "usage: something else" in message


def test_a_program_that_sends_no_message(tmp_path: Path) -> None:
    path = program(tmp_path / "python", 'eval "echo good morning to you >&$3"\n')
    assert "is not a Python with bpy" in failure(BlenderOptions(python=path))


def test_a_program_that_never_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "START_LIMIT_S", 0.3)
    monkeypatch.setattr(child, "END_LIMIT_S", 0.1)
    path = program(tmp_path / "python", "exec sleep 60\n")
    assert "did not answer" in failure(BlenderOptions(python=path))


def test_a_python_without_bpy(tmp_path: Path) -> None:
    path = python_with(tmp_path / "python", "sys.modules['bpy'] = None")
    message = failure(BlenderOptions(python=path))
    assert "has no usable bpy" in message
    assert "pip install 'bpy==5.0.1'" in message


def test_a_python_without_numpy(tmp_path: Path) -> None:
    path = python_with(tmp_path / "python", "sys.modules['numpy'] = None")
    assert "numpy" in failure(BlenderOptions(python=path))


def test_a_blender_that_is_too_old(tmp_path: Path) -> None:
    app = "types.SimpleNamespace(version=(3, 6, 0), version_string='3.6.0')"
    path = python_with(tmp_path / "python", f"sys.modules['bpy'] = types.SimpleNamespace(app={app})")
    assert "has Blender 3.6.0, older than 4.5.0" in failure(BlenderOptions(python=path))


def test_the_order_in_which_interpreters_are_looked_for(tmp_path: Path) -> None:
    one, two = (program(tmp_path / name, "exit 0\n") for name in ("one", "two"))
    both = {"POSSE_BLENDER_PYTHON": one, "POSSE_BLENDER": two}

    def found(options: BlenderOptions, environ: dict[str, str]) -> tuple[str, bool]:
        interpreter = find_interpreter(options, environ)
        return interpreter.path, interpreter.is_blender

    assert found(BlenderOptions(executable=two), both) == (two, True)
    assert found(BlenderOptions(python=two), both) == (two, False)
    assert found(BlenderOptions(), both) == (one, False)
    assert found(BlenderOptions(), {"POSSE_BLENDER": two}) == (two, True)
    assert found(BlenderOptions(), {})[0] == sys.executable


def test_python_and_executable_exclude_each_other() -> None:
    with pytest.raises(ValidationError, match="give python or executable, not both"):
        BlenderOptions.model_validate({"python": "a", "executable": "b"})


def test_a_gpu_that_is_absent(blender: None) -> None:
    options = BlenderOptions(device="metal")  # no machine that runs these tests has one
    with pytest.raises(ComponentError, match="use device: cpu") as caught:
        BlenderRenderer(options).open(plate())
    assert "\n" not in str(caught.value)
    assert BlenderRenderer.doctor(options)[-1][:2] == ("device", False)


def test_doctor_reports_what_works(blender: None) -> None:
    records = BlenderRenderer.doctor(BlenderOptions())
    assert [(what, ok) for what, ok, _ in records] == [
        ("interpreter", True),
        ("bpy", True),
        ("device", True),
    ]


def test_a_worker_that_is_killed_during_a_frame(opened: Callable[..., BlenderRenderer]) -> None:
    renderer = opened(plate(), spp=ENDLESS_SPP, adaptive_threshold=0)
    pid = renderer.worker_pid
    assert pid is not None
    killer = threading.Timer(1.0, os.kill, (pid, signal.SIGKILL))
    killer.start()
    with pytest.raises(WorkerLost, match=rf"process {pid}.*SIGKILL while rendering frame 0") as caught:
        renderer.render(request())
    assert "\n" not in str(caught.value)
    with pytest.raises(ComponentError):  # the worker is not restarted automatically
        renderer.render(request())
    renderer.options = BlenderOptions(spp=4, threads=1)
    renderer.open(plate())
    assert renderer.worker_pid != pid
    assert renderer.render(request()).coverage.max() == 1.0


def test_an_exception_in_the_worker_is_reported_and_survived(
    opened: Callable[..., BlenderRenderer],
) -> None:
    renderer = opened(plate())
    good = request()
    bad_light = replace(good.craft, sun_irradiance_rgb_w_m2=np.ones(2))
    bad = RenderRequest(bad_light, good.box, None, seed=1)
    with pytest.raises(ComponentError, match="rendering frame 0 failed: ValueError"):
        renderer.render(bad)
    assert renderer.render(request()).coverage.max() == 1.0


PARENT = """
import sys
from posse_render_blender.options import BlenderOptions
from posse_render_blender.renderer import BlenderRenderer
sys.path.insert(0, {folder!r})
import test_faults
renderer = BlenderRenderer(BlenderOptions(spp=test_faults.ENDLESS_SPP, threads=1, adaptive_threshold=0))
renderer.open(test_faults.plate())
print(renderer.worker_pid, flush=True)
renderer.render(test_faults.request())
"""


def test_the_worker_ends_with_its_parent_during_a_frame(blender: None, tmp_path: Path) -> None:
    code = PARENT.format(folder=str(Path(__file__).parent))
    with subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    ) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        time.sleep(1.0)
        assert _is_running(pid)
        parent.kill()
    # The frame would take days; the worker must end in the middle of it and delete its folder.
    deadline = time.monotonic() + 30
    while _is_running(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _is_running(pid)
    assert not list(tmp_path.iterdir())


def _is_running(pid: int) -> bool:
    """Whether a process still runs; a zombie that has not been waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_two_renderers_at_once(opened: Callable[..., BlenderRenderer]) -> None:
    one, two = opened(plate()), opened(plate())
    first, second = one.render(request()), two.render(request())
    np.testing.assert_array_equal(first.radiance_rgb, second.radiance_rgb)
    one.close()
    np.testing.assert_array_equal(two.render(request()).radiance_rgb, second.radiance_rgb)


def test_nothing_is_printed(
    opened: Callable[..., BlenderRenderer], capfd: pytest.CaptureFixture[str]
) -> None:
    renderer = opened(plate())
    renderer.render(request())
    renderer.close()
    assert capfd.readouterr() == ("", "")
    renderer.close()


def test_temporary_files_are_gone_after_close(
    opened: Callable[..., BlenderRenderer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    renderer = opened(plate())
    renderer.render(request())
    assert list(tmp_path.iterdir())
    renderer.close()
    assert not list(tmp_path.iterdir())


def test_a_worker_sleeps_between_frames(opened: Callable[..., BlenderRenderer]) -> None:
    renderer = opened(plate(), threads=1)
    renderer.render(request())
    before = _cpu_s(renderer.worker_pid)
    time.sleep(1.0)
    assert _cpu_s(renderer.worker_pid) - before < 0.2


def _cpu_s(pid: int | None) -> float:
    stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")
