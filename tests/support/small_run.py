"""A scenario small enough to run many times: a box in orbit, 64 × 48 pixels, a flat renderer."""

from collections.abc import Callable, Iterable
from pathlib import Path
from subprocess import CompletedProcess

BOX_OBJ = """\
v -2 -1 -1
v 2 -1 -1
v 2 1 -1
v -2 1 -1
v -2 -1 1
v 2 -1 1
v 2 1 1
v -2 1 1
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""

SCENARIO = """\
target: {mesh: box.obj, scale_m_per_unit: 1.0, body_axes: "x y z"}
orbit:
  elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7080000, e: 0.001, i_deg: 98, raan_deg: 10,
             argp_deg: 20, mean_anomaly_deg: 30}
relative: {roe_m: [0, 0, 6, 0, 6, 0]}
times: {duration_orbits: 1, count: 8}
camera: {width_px: 64, height_px: 48}
sky: {earth: false, stars: null}
sensor: {noise: {gaussian_dn: 3}}
renderer: {name: flat, seconds: 0.05}
writers: [coco, speed]
seed: 7
"""


def make_small(
    posse_in: Callable[..., CompletedProcess[str]], folder: Path, options: Iterable[str]
) -> Path:
    """Run the scenario in ``folder`` with other keys, KEY=VALUE; the dataset's folder."""
    (folder / "small.yaml").write_text(SCENARIO)
    words = [word for option in options for word in ("-o", option)]
    done = posse_in(folder, "run", "small.yaml", "--out", "d", *words)
    assert done.returncode == 0, done.stderr
    return folder / "d"
