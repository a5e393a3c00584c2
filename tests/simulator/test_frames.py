"""Frames of a simulator: those of a run, to the bit, whatever was asked for before or has died."""

import hashlib
import json
import re

import pytest

LOOP = """
import hashlib, json
import numpy as np
import posse_core as posse

def digest(shot):
    whole = hashlib.sha256(shot.image.tobytes() + shot.labels.to_json())
    for name in sorted(shot.arrays):
        whole.update(shot.arrays[name].tobytes())
    return whole.hexdigest()

with posse.open("small.yaml") as sim:
    r_rtn_m, digests = np.array([2.0, -15.0, 1.0]), []
    for index in range(12):
        shot = sim.frame(sim.state(index, t_s=7.0 * index, r_rtn_m=r_rtn_m))
        assert shot.labels.range_m == float(np.linalg.norm(shot.state.craft.t_body_cam_m))
        r_rtn_m = r_rtn_m * (1 - 0.01 * shot.coverage.mean())
        digests.append(digest(shot))
print(json.dumps(digests))
"""

AGAINST_A_RUN = """
import json
import re
from pathlib import Path
import numpy as np
import posse_core as posse

dataset = posse.run("small.yaml", "d", workers=2)
with posse.open("small.yaml") as sim:
    lines = Path("d/labels/shard-00000.jsonl").read_bytes().splitlines()
    for index, line in reversed(list(enumerate(lines))):
        shot = sim.frame(sim.state(index))
        files = {"image": f"images/{index:06d}.png", "truth": f"truth/{index:06d}.npz"}
        assert shot.labels.model_copy(update=files).to_json() == line
        assert np.array_equal(shot.image, dataset.image(index))
        truth = dataset.truth(index)
        assert shot.arrays.keys() == truth.keys()
        for name, array in truth.items():
            assert np.array_equal(shot.arrays[name], array, equal_nan=True), name
print(json.dumps(len(lines)))
"""


def test_a_frame_of_the_scenario_is_the_runs_to_the_bit(run_script, small_scenario, tmp_path):
    """Taken in the opposite order, in one process; and the run needs no guard in the script."""
    for path in small_scenario.parent.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    assert run_script(AGAINST_A_RUN, folder=tmp_path) == 8


def test_a_loop_of_states_is_repeated_to_the_bit_though_the_renderer_dies(run_script, tmp_path):
    undisturbed = run_script(LOOP)
    assert len(set(undisturbed)) == 12
    disturbed = run_script(LOOP, env={"FLAT_LOSE_ONCE": f"5,{tmp_path / 'lost'}"})
    assert (tmp_path / "lost").exists()
    assert disturbed == undisturbed


def test_a_renderer_that_dies_at_every_try_is_an_error(run_script):
    said = run_script(
        """
import json, os
import posse_core as posse
with posse.open("small.yaml") as sim:
    state = sim.state(3)
    try:
        sim.frame(state)
    except posse.WorkerLost as error:
        said = str(error)
    os.environ.pop("FLAT_LOSE")
    sim.frame(state)
print(json.dumps(said))
""",
        env={"FLAT_LOSE": "3"},
    )
    assert said == "the lamp's process has died, 3 times"


def test_light_is_that_of_the_renderer_and_of_the_sky(run_script):
    values = run_script(
        """
import json
import re
import numpy as np
import posse_core as posse
overrides = {"renderer.radiance_w_m2_sr": 7.0, "sky.earth": True}
with posse.open("small.yaml", overrides=overrides) as sim:
    shot = sim.frame(sim.state(4, r_rtn_m=[12, 0, 0]))
    inside = shot.coverage == 1
    assert shot.craft_radiance_rgb.shape == shot.sky_radiance_rgb.shape == (48, 64, 3)
    assert inside.any() and not inside.all()
    assert (shot.craft_radiance_rgb[inside] == 7).all() and not shot.craft_radiance_rgb[~inside].any()
    assert shot.sky_radiance_rgb.max() > 1 and shot.image.dtype == np.uint8
print(json.dumps([shot.exposure_s, repr(shot), repr(sim)]))
"""
    )
    exposure_s, frame, simulator = values
    assert exposure_s == 0.002
    assert re.fullmatch(r"<Frame 4: 64 × 48, t = 338\d\.\d+ s, range 12.0 m>", frame)
    assert simulator == "<Simulator of box: 64 × 48, renderer flat>"


def test_a_scenario_may_be_a_mapping(run_script):
    """The same keys by a file and by a program give the same frame."""
    digests = run_script(
        """
import hashlib, json, yaml
from pathlib import Path
import posse_core as posse
keys = yaml.safe_load(Path("small.yaml").read_text().replace("27.58", "27.58Z"))
keys["orbit"]["elements"]["epoch_utc"] = "2022-01-31T02:02:27.58"
before = json.dumps(keys)
digests = []
for source in (keys, "small.yaml"):
    with posse.open(source, seed=11) as sim:
        digests.append(hashlib.sha256(sim.frame(sim.state(2)).image.tobytes()).hexdigest())
assert json.dumps(keys) == before
print(json.dumps(digests))
"""
    )
    assert digests[0] == digests[1] != hashlib.sha256(b"").hexdigest()


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        ("posse.open('posse')", "posse: a collection; name one of its scenarios: posse-v1, posse-v2"),
        ("posse.open('aqa')", "no scenario named 'aqa'; did you mean 'aqua'?"),
        ("posse.open({'target': 'aqua'})", "scenario: orbit: missing; add it"),
        ("posse.open('aqua', renderer='rastr')", "no renderer named 'rastr'"),
        ("posse.open('aqua', overrides={'camera.widht_px': 3})", "did you mean 'width_px'?"),
        ("posse.create('renderer', 'flat', second=1)", "unknown key; did you mean 'seconds'?"),
        ("posse.create('rendrer', 'flat')", "no kind of component named 'rendrer'"),
    ],
)
def test_what_cannot_be_opened_is_said_in_one_line(run_script, call, expected):
    said = run_script(
        f"""
import json
import re
import posse_core as posse
try:
    {call}
except posse.InputError as error:
    print(json.dumps(str(error)))
"""
    )
    assert expected in said
    assert "\n" not in json.dumps(said)
