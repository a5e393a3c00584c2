"""Build all distributions, check them, and try the wheels alone in a fresh environment.

``python packaging/try_dist.py DIST PYTHON...`` writes sdists and wheels to the folder DIST and tries the
wheels with each PYTHON. It needs build, setuptools and twine, which ``make dist`` provides, and git,
which knows the files of the project.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = {
    ".": "posse_core",
    "plugins/detect_onnx": "src/posse_detect_onnx",
    "plugins/detect_torch": "src/posse_detect_torch",
    "plugins/executor_ray": "src/posse_executor_ray",
    "plugins/render_blender": "src/posse_render_blender",
    "plugins/render_mitsuba": "src/posse_render_mitsuba",
    "plugins/render_raster": "src/posse_render_raster",
    "packaging/posse": None,
}
"""Folder of each distribution → its package there, of which the wheel has all files and nothing else."""
EXTRAS = ("mitsuba", "raster", "blender", "onnx")
"""Installed and tried. What torch and ray need is large; their wheels are built and checked too."""
SMALL = ("-o", "camera.width_px=480", "-o", "camera.height_px=360")
COMMANDS: Mapping[str, tuple[str, ...]] = {
    "version": ("--version",),
    "doctor": ("doctor",),
    "run": ("run", "aqua", "--renderer", "raster", "--frames", "2", *SMALL, "--out", "d"),
    "validate": ("validate", "d"),
    "view": ("view", "d"),
    "detect": ("detect", "d/images", "--json"),
    "fly": (
        *("fly", "fly-hold", "--renderer", "raster", *SMALL, "--out", "f"),
        *("-o", "flight.duration_s=20", "-o", "flight.controller=hold", "-o", "flight.goal=null"),
    ),
}
"""What is tried in an empty folder, each within two minutes."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dist", type=Path)
    parser.add_argument("python", nargs="+", help="interpreter that the wheels are tried with")
    given = parser.parse_args()
    dist: Path = given.dist.absolute()
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="posse-dist-") as folder:
        source = Path(folder) / "source"
        copy_of_project(source)
        shutil.rmtree(dist, ignore_errors=True)
        for name in PACKAGES:
            build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(dist)]
            run(*build, str(source / name), cwd=folder)
        say(f"built after {time.monotonic() - started:.0f} s")
        check(dist, source)
        shutil.rmtree(source)
        for number, interpreter in enumerate(given.python):
            work = Path(folder) / f"work-{number}"
            work.mkdir()
            python = Path(folder) / f"venv-{number}" / "bin" / "python"
            run(interpreter, "-m", "venv", str(python.parents[1]), cwd=work)
            install(python, dist, work)
            version = run(str(python), "--version", cwd=work).strip()
            say(f"{version}: installed after {time.monotonic() - started:.0f} s")
            try_commands(python, work)
            shutil.rmtree(python.parents[1])
    say(f"all passed after {time.monotonic() - started:.0f} s")


def copy_of_project(target: Path) -> None:
    """Copy the files that git knows or would add: building leaves files in the folders it builds."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    names = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, names.split("\0")):
        if os.path.lexists(ROOT / name):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name, follow_symlinks=False)


def check(dist: Path, source: Path) -> None:
    """Compare what the wheels hold with the packages, and check metadata and readmes."""
    wheels, sdists = sorted(dist.glob("*.whl")), sorted(dist.glob("*.tar.gz"))
    assert len(wheels) == len(sdists) == len(PACKAGES), "a distribution is missing"
    plugins = {path.parent.relative_to(source) for path in source.glob("plugins/*/pyproject.toml")}
    assert plugins <= set(map(Path, PACKAGES)), f"a plugin is not listed: {plugins}"
    version = (ROOT / "posse_core" / "VERSION").read_text("utf-8").strip()
    run(sys.executable, "-m", "twine", "check", "--strict", *map(str, (*wheels, *sdists)), cwd=dist)
    expected = {
        Path(package).name: set(files_of(source / folder / package))
        for folder, package in PACKAGES.items()
        if package is not None
    }
    for wheel in wheels:
        name, its_version = wheel.name.split("-")[:2]
        held = {n for n in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in n}
        named = name if name in expected or name == "posse" else None
        assert named is not None, f"{wheel.name} is of no package"
        assert held == expected.get(name, set()), f"{wheel.name}: {held ^ expected.get(name, set())}"
        assert its_version == version, f"{wheel.name} is not of version {version}"
        licences = [n for n in zipfile.ZipFile(wheel).namelist() if "/licenses/" in n]
        assert licences, f"{wheel.name} has no licence"
        say(f"{wheel.name}: {len(held)} files, {wheel.stat().st_size / 1e6:.2f} MB")
    for sdist in sdists:
        with tarfile.open(sdist) as archive:
            names = archive.getnames()
            assert all(not member.issym() for member in archive.getmembers()), f"{sdist.name} has links"
        assert not any("/tests/" in name for name in names), f"{sdist.name} has a part of the tests"
        say(f"{sdist.name}: {len(names)} files, {sdist.stat().st_size / 1e6:.2f} MB")


def files_of(package: Path) -> Iterator[str]:
    """The files of a package as a wheel names them."""
    for path in package.rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts:
            yield path.relative_to(package.parent).as_posix()


def install(python: Path, dist: Path, work: Path) -> None:
    """Install the wheels, all given by their files, so that none of an index takes their place."""
    version = (ROOT / "posse_core" / "VERSION").read_text("utf-8").strip()
    wheels = {wheel.name.split("-")[0]: wheel for wheel in dist.glob("*.whl")}
    chosen = [f"{wheels['posse']}[{','.join(EXTRAS)}]", str(wheels["posse_core"])]
    for extra in EXTRAS:
        chosen += [str(path) for name, path in wheels.items() if name.endswith(f"_{extra}")]
    run(str(python), "-m", "pip", "install", "--quiet", *chosen, cwd=work)
    installed = json.loads(posse(python, work, "plugins", "--json"))
    assert len(installed) == len(EXTRAS) + 1, installed
    for plugin in installed:
        assert (plugin["state"], plugin["version"]) == ("ok", version), plugin


def try_commands(python: Path, work: Path) -> None:
    where = "import posse_core; print(posse_core.__file__)"
    imported = run(str(python), "-c", where, cwd=work).strip()
    assert imported.startswith(str(python.parents[1])), f"posse_core is imported from {imported}"
    for what, arguments in COMMANDS.items():
        begun = time.monotonic()
        said = posse(python, work, *arguments)
        say(f"posse {what}: {time.monotonic() - begun:.1f} s")
        if what == "detect":
            images = json.loads(said)
            assert len(images) == 2, said
            found = [{each["label"] for each in image["detections"]} for image in images]
            assert all("aqua" in labels for labels in found), f"Aqua was not found: {said}"


def posse(python: Path, work: Path, *arguments: str) -> str:
    return run(str(python.with_name("posse")), *arguments, cwd=work)


def run(*command: str, cwd: Path | str) -> str:
    """Run a command that must succeed, apart from whatever Python path this process has."""
    env = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)} ended with {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done.stdout


def say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    main()
