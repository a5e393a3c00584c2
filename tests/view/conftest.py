"""Pages of the cuboid's dataset, and what a real browser makes of them."""

import html
import json
import re
import subprocess
from pathlib import Path

import cuboid
import cuboid_sensors
import pytest
from browser import chromium
from click.testing import CliRunner

from posse_core._cli.view import command as view_command

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1400,1000",
    "--virtual-time-budget=5000",
    "--dump-dom",
)


@pytest.fixture(scope="session")
def view():
    """Run ``posse view``."""
    return lambda *arguments: CliRunner().invoke(view_command, [str(argument) for argument in arguments])


@pytest.fixture(scope="session")
def two_crafts(tmp_path_factory) -> Path:
    """Twelve frames of a brick and a plate. Tests must not change it."""
    crafts = (("brick", cuboid.HALF), ("plate", cuboid.HALF * [1.4, 1.0, 0.1]))
    return cuboid.write_dataset(tmp_path_factory.mktemp("view") / "d", crafts)


@pytest.fixture(scope="session")
def sensed(tmp_path_factory) -> Path:
    """Six frames of a brick with readings of five sensors. Tests must not change it."""
    return cuboid_sensors.add_readings(cuboid.write_dataset(tmp_path_factory.mktemp("sensed") / "d"))


@pytest.fixture(scope="session")
def browse(tmp_path_factory):
    """browse(page, script, address): what the script, run after the page's own, leaves in ``told``.

    ``address`` is what the page's address ends with, such as ``#frame=3``.
    Errors that the page itself raised are in ``told.errors``.
    """
    command = chromium()

    def run(page: Path, script: str, address: str = "") -> dict:
        watch = "<script>const told = {errors: []}; onerror = (e) => void told.errors.push(e);</script>"
        tell = f"""<pre id="told"></pre><script>setTimeout(() => {{ {script}
            document.getElementById("told").textContent = JSON.stringify(told); }}, 1500);</script>"""
        text = page.read_text().replace("<style>", watch + "<style>", 1)
        probe = page.with_name(f"probe-{page.name}")
        probe.write_text(text.replace("</body>", tell + "</body>"))
        profile = tmp_path_factory.mktemp("profile")
        done = subprocess.run(
            [command, *FLAGS, f"--user-data-dir={profile}", probe.as_uri() + address],
            capture_output=True,
            text=True,
            timeout=120,
        )
        found = re.search(r'<pre id="told">(.+?)</pre>', done.stdout, re.DOTALL)
        assert found, f"the page told nothing: {done.stderr[-2000:]}"
        return json.loads(html.unescape(found[1]))

    return run
