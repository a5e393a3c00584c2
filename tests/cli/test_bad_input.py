"""Bad input ends with exit code 2, one line that names cause and way out, and nothing half-made."""

import subprocess
import sys

import pytest

TLE_1 = "1 27424U 02022A   22031.08504144  .00000000  00000-0  00000-0 0  9999"
TLE_2 = "2 27424  98.2300 334.4000 0000898  52.4400 318.1000 14.57112000 53087"


def scenario(tle: tuple[str, str] = (TLE_1, TLE_2), target: str = "{name: aqua}", more: str = "") -> str:
    return f'target: {target}\norbit:\n  tle:\n    - "{tle[0]}"\n    - "{tle[1]}"\n{more}'


CASES = {
    "TLE checksum": (scenario((TLE_1[:-1] + "0", TLE_2)), ["s.yaml", "tle", "checksum"]),
    "TLE too short": (scenario((TLE_1, TLE_2[:40])), ["tle", "69"]),
    "unknown renderer": (scenario(more="renderer: mitsubba\n"), ["line 6", "'mitsubba'", "Installed"]),
    "unknown key": (scenario(more="sensr: {}\n"), ["line 6", "sensr", "did you mean 'sensor'"]),
    "negative": (scenario(more="sensor: {exposure_s: -1}\n"), ["line 6", "sensor.exposure_s", "-1"]),
    "NaN": (scenario(more="relative: {roe_m: [0, 0, .nan, 0, 0, 0]}\n"), ["line 6", "roe_m.2"]),
    "missing mesh": (
        scenario(target='{mesh: no.obj, scale_m_per_unit: 1.0, body_axes: "x y z"}'),
        ["no.obj"],
    ),
    "hyperbolic": (
        "target: {name: aqua}\norbit: {state_eci: {epoch_utc: 2022-01-31T00:00:00,"
        " r_m: [7e6, 0, 0], v_m_s: [0, 12000, 0]}}\n",
        ["s.yaml", "orbit.state_eci", "not elliptic"],
    ),
    "below the surface": (
        "target: {name: aqua}\norbit: {elements: {epoch_utc: 2022-01-31T00:00:00, a_m: 7e6, e: 0.5,"
        " i_deg: 1, raan_deg: 0, argp_deg: 0, mean_anomaly_deg: 0}}\n",
        ["s.yaml", "orbit.elements", "surface"],
    ),
    "a number for a path": (
        scenario(target='{mesh: 3, scale_m_per_unit: 1.0, body_axes: "x y z"}'),
        ["line 1: target.mesh: input should be a path (it is 3)"],
    ),
    "a flight without end": (
        scenario(more="flight: {duration_s: 9223372036854775808}\n"),
        ["line 6: flight", "more than 500000 frames", "lower duration_s"],
    ),
    "waypoints without end": (
        scenario(
            more="flight: {duration_s: 1000, goal: {orbit: {relative: {roe_m: [0, 0, 6, 0, 6, 0]},"
            " from_s: 10, every_s: 1.0e-30}}}\n"
        ),
        ["line 6: flight", "goal.orbit", "give a longer every_s"],
    ),
    "date": (
        "target: {name: aqua}\norbit: {elements: {epoch_utc: 2022-13-31T00:00:00, a_m: 7e6, e: 0,"
        " i_deg: 1, raan_deg: 0, argp_deg: 0, mean_anomaly_deg: 0}}\n",
        ["2022-13-31"],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_scenario(case, posse, tmp_path):
    text, words = CASES[case]
    if "renderer:" not in text:
        text += "renderer: flat\n"
    (tmp_path / "s.yaml").write_text(text)
    _refused(posse("run", "s.yaml", "--out", "d"), words)
    assert not (tmp_path / "d").exists()


def test_an_option_within_a_value_is_told_by_the_line_of_the_value(posse, tmp_path):
    (tmp_path / "s.yaml").write_text(scenario(more="renderer: 3\n"))
    done = posse("run", "s.yaml", "--out", "d", "--renderer", "raster")
    _refused(done, ["s.yaml, line 6: renderer: holds a value", "renderer.name cannot be set"])


def test_bad_arguments(posse, tmp_path):
    _refused(posse("rnu"), ["'rnu'", "did you mean 'run'"])
    _refused(posse("run", "--framse", 3), ["--framse"])
    _refused(posse("run", "aqua", "--frames", 0, "--renderer", "flat"), ["option frames", "0"])
    _refused(posse("run", "aqua", "--workers", 0, "--renderer", "flat"), ["workers", "0"])
    _refused(posse("run", "aqua", "--executor", "lokal", "--renderer", "flat"), ["'lokal'", "local"])
    _refused(posse("describe", "renderers"), ["renderers", "did you mean 'renderer'"])
    _refused(posse("propagate", "aqua", "--out", "x.txt", "-o", "renderer.name=flat"), [".npz or .csv"])
    _refused(posse("run", "--resume"), ["--out"])
    _refused(posse("run", "--resume", "--out", "new"), ["new has no scenario.yaml", "name the scenario"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("eval", "first", "--target", ""), "--target is empty"),
        (("eval", "first", "--target="), "--target is empty"),
        (("run", "aqua", "-o", " "), "-o is empty"),
        (("run", ""), "an argument after 'run' is empty"),
    ],
)
def test_a_variable_of_the_shell_that_is_not_set_is_told(posse, tmp_path, arguments, named):
    _refused(posse(*arguments), [named, "leave it out"])
    assert list(tmp_path.iterdir()) == []


def test_a_model_outside_its_domain_warns_in_one_line(posse, tmp_path):
    orbit = CASES["date"][0].replace("-13-", "-01-").replace("e: 0,", "e: 0.01,")
    (tmp_path / "s.yaml").write_text(orbit + "renderer: flat\npropagator: hcw\n")
    done = posse("propagate", "s.yaml", "--out", "x.npz")
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("posse: warning: ")
    assert "hcw" in line


def test_a_hyperbolic_orbit_flies_where_no_period_is_asked_for(posse, tmp_path):
    text, _ = CASES["hyperbolic"]
    text += "renderer: flat\npropagator: nonlinear\ntimes: {duration_s: 600, count: 4}\n"
    (tmp_path / "s.yaml").write_text(
        text + "relative: {state_rtn: {r_m: [0, 20, 0], v_m_s: [0, 0, 0]}}\n"
    )
    done = posse("propagate", "s.yaml", "--out", "x.npz")
    assert done.returncode == 0, done.stderr


def test_an_output_folder_that_is_not_ours_is_left_alone(posse, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years of work")
    arguments = ("run", "aqua", "--renderer", "flat", "--out")
    _refused(posse(*arguments, "mine"), ["mine", "not empty", "another folder"])
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.tex"]
    _refused(posse(*arguments, "mine/thesis.tex"), ["thesis.tex", "is a file"])
    _refused(posse(*arguments, "/proc/d"), ["/proc/d", "another folder"])


def _refused(done, words) -> None:
    assert done.returncode == 2, done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("posse: ")
    for word in words:
        assert word in lines[0]


def test_listing_loads_no_heavy_library():
    heavy = {"torch", "bpy", "mitsuba", "OpenGL", "pyrender", "moderngl", "drjit"}
    code = (
        "import sys, posse_core._cli.main as m; m._run(['plugins']);"
        f" print(sorted({heavy} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.splitlines()[-1] == "[]", done.stdout + done.stderr


def test_describe_tells_every_key(posse):
    text = posse("describe", "scenario").stdout
    for line in text.splitlines()[1:]:
        assert not line.rstrip().endswith(":"), f"a key without a description: {line}"
    for key in ("tle", "roe_m", "hfov_deg", "exposure_s", "renderer", "seed", "solar_constant_w_m2"):
        assert f" {key}" in text
    assert '"exposure_s"' in posse("describe", "scenario", "--json").stdout
