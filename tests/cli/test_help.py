"""The help of every command appears without importing the libraries that its work needs."""

import json
import subprocess
import sys

NUMERICAL = ["casadi", "cv2", "embreex", "erfa", "scipy", "sgp4", "trimesh"]
SCRIPT = """
import contextlib, io, json, sys
from posse_core._cli.main import posse
from posse_core._plugins.loading import load_plugins

for name in ("", *load_plugins().registry.names("subcommand")):
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown):
        posse.main([*filter(None, [name]), "--help"], prog_name="posse", standalone_mode=False)
    print(json.dumps({"help": shown.getvalue(), "imported": [m for m in NUMERICAL if m in sys.modules]}))
"""


def test_no_help_imports_a_numerical_library():
    code = f"NUMERICAL = {NUMERICAL}\n{SCRIPT}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    shown = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(shown) > 15
    for entry in shown:
        assert entry["help"].startswith("Usage: posse")
        assert entry["imported"] == [], entry["help"].splitlines()[0]
