"""What a scenario file may say, and what is said of a wrong one."""

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from posse_core._cli.describe import command as describe
from posse_core._errors import InputError
from posse_core._imaging.image_sensor import FULL_WELL_E_M2, ImageSensor
from posse_core._plugins.loading import load_plugins
from posse_core._scenario.built_in_names import built_in_names
from posse_core._scenario.camera import preset_camera
from posse_core._scenario.load import (
    dump_scenario,
    load_scenario,
    parse_override,
    scenario_members,
)
from posse_core._scenario.presets import PRESETS
from posse_core._scenario.yaml_lines import YamlText

MINIMAL = """\
target: {name: aqua}
orbit:
  elements: {epoch_utc: 2022-01-31T02:02:27.58, a_m: 7123931.35, e: 8.98e-5, i_deg: 98.23,
             raan_deg: 334.40, argp_deg: 52.44, mean_anomaly_deg: 318.10}
renderer: test
"""


class _TestRegistry:
    """The process's registry with a renderer, which the core has none of."""

    def __init__(self) -> None:
        self._registry = load_plugins().registry

    def options_model(self, kind, name):
        if (kind, name) == ("renderer", "test"):
            return self._registry.options_model("executor", "local")
        return self._registry.options_model(kind, name)

    def spec(self, kind, name):
        return self._registry.spec(kind, name)


REGISTRY = _TestRegistry()


def load(tmp_path: Path, text: str, **overrides):
    path = tmp_path / "s.yaml"
    path.write_text(text)
    return load_scenario(str(path), REGISTRY, overrides)


def test_only_target_and_orbit_are_needed(tmp_path):
    scenario = load(tmp_path, MINIMAL)
    assert scenario.camera.width_px == 1280
    camera = scenario.camera.camera()
    # The thesis' Table 3.5: 90° over 36 mm is f = 18 mm (by tan) and 640 px; pitch 28.12 µm.
    assert camera.fx_px == pytest.approx(640)
    assert camera.focal_length_m == pytest.approx(18e-3)
    assert camera.pixel_pitch_m == pytest.approx(28.125e-6)
    assert (camera.cx_px, camera.cy_px) == (639.5, 479.5)


def test_constants_are_the_standards_and_the_thesis_brings_its_own_sun(tmp_path):
    constants = load(tmp_path, MINIMAL).constants
    # WGS 84 and EGM96; IAU 2015 resolution B3; IAU 2012 resolution B2.
    assert constants.mu_earth_m3_s2 == 3.986004418e14
    assert constants.earth_radius_m == 6378137
    assert constants.j2 == 1.08262668e-3
    assert constants.sun_radius_m == 695_700e3
    assert constants.au_m == 149_597_870.7e3
    assert constants.solar_constant_w_m2 == 1361
    assert constants.eclipse_flattening == 0
    thesis = MINIMAL + "propagator: thesis\n"
    assert load(tmp_path, thesis).constants == constants.model_copy(update={"solar_constant_w_m2": 1367})
    given = thesis + "constants: {solar_constant_w_m2: 1362, j2: 0}\n"
    assert load(tmp_path, given).constants.solar_constant_w_m2 == 1362
    assert load(tmp_path, given).constants.j2 == 0


def test_a_date_stays_text_and_an_exponent_is_a_number(tmp_path):
    elements = load(tmp_path, MINIMAL).orbit.elements
    assert elements.epoch_utc == "2022-01-31T02:02:27.58"
    assert elements.e == 8.98e-5
    assert YamlText("a: 1e5\nb: no\nc: 010", "t").value == {"a": 1e5, "b": "no", "c": 10}


def test_a_dumped_scenario_loads_to_itself(tmp_path):
    scenario = load(tmp_path, MINIMAL + "camera: {width_px: 64}\nseed: 5\n")
    (tmp_path / "dumped.yaml").write_text(dump_scenario(scenario))
    assert load_scenario(str(tmp_path / "dumped.yaml"), REGISTRY) == scenario


@pytest.mark.parametrize("name", built_in_names())
def test_built_in_scenarios_load(name):
    for member in scenario_members(name):
        load_scenario(member.source, REGISTRY, {**member.overrides, "renderer.name": "test"})


def test_a_collection_replaces_keys_of_its_members(tmp_path):
    """Of the thesis' datasets, only POSSE has stars (its Table 5.1)."""
    gains = {
        name: {
            None if stars is None else stars.gain
            for member in scenario_members(name)
            for stars in [
                load_scenario(
                    member.source, REGISTRY, {**member.overrides, "renderer.name": "test"}
                ).sky.stars
            ]
        }
        for name in ("posse-v1", "posse-v2", "posse-v3", "posse-v4", "posse")
    }
    assert gains.pop("posse") == {1e6}
    assert list(gains.values()) == [{None}] * 4
    (tmp_path / "one.yaml").write_text(MINIMAL)
    both = tmp_path / "both.yaml"
    both.write_text("members: [one.yaml, aqua]\noverrides: {camera.width_px: 77}\n")
    for member in scenario_members(str(both)):
        made = load_scenario(member.source, REGISTRY, {**member.overrides, "renderer.name": "test"})
        assert made.camera.width_px == 77


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("members: []", "members: a collection has a list of scenarios here"),
        ("members: [aqua]\noverrides: 3", "overrides: give dotted keys and values"),
        ("members: [aqua]\noverride: {}", "override: a collection has the keys members and overrides"),
    ],
)
def test_a_wrong_collection_is_told(tmp_path, text, told):
    path = tmp_path / "c.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=f"c.yaml.*{told}"):
        scenario_members(str(path))


def test_naming_another_component_leaves_the_formers_options(tmp_path):
    text = MINIMAL.replace("renderer: test", "renderer: {name: mitsuba, spp: 3}")
    scenario = load(tmp_path, text, **{"renderer.workers": 2, "renderer.name": "test"})
    assert scenario.renderer.name == "test"
    assert scenario.renderer.options["workers"] == 2
    assert "spp" not in scenario.renderer.options


def test_options_without_a_name_are_the_defaults(tmp_path):
    assert load(tmp_path, MINIMAL + "propagator: {}\n").propagator.name == "roe"
    with pytest.raises(InputError, match=r"propagator\.no_such_option: unknown key"):
        load(tmp_path, MINIMAL, **{"propagator.no_such_option": 1})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["a scenario is a mapping"]),
        ("target: [", ["s.yaml, line", "not valid YAML"]),
        (MINIMAL + "seed: 1\nseed: 2\n", ["line 7", "'seed'", "twice"]),
        (MINIMAL + "sead: 1\n", ["line 6", "sead", "did you mean 'seed'"]),
        (MINIMAL + "camera:\n  hfov: 90\n", ["line 7", "camera.hfov", "did you mean 'hfov_deg'"]),
        (MINIMAL + "camera: {hfov_deg: 180}\n", ["camera.hfov_deg", "180"]),
        (MINIMAL + "camera: {width_px: -3}\n", ["camera.width_px", "-3"]),
        (MINIMAL + "camera: {preset: sped}\n", ["line 6", "camera.preset", "did you mean 'speed'"]),
        (MINIMAL + "camera: {hfov_deg: 40, focal_px: [9, 9]}\n", ["camera.focal_px", "not both"]),
        (MINIMAL + "camera: {distortion: [0.1, 0]}\n", ["camera.distortion"]),
        (
            MINIMAL + "camera: {distortion: [-0.3, 0, 0, 0, 0]}\n",
            ["line 6", "camera.distortion", "folds over inside the image", "46.5 degrees"],
        ),
        (
            MINIMAL + "camera: {distortion: [0.01, 0, 0, 0, 0]}\nwriters: [coco, bop]\n",
            ["line 7", "writers.1.name", "'bop' supports only pinhole cameras"],
        ),
        (
            MINIMAL + "camera: {line_time_s: 1.0e-5}\nwriters: [coco, colmap]\n",
            ["line 7", "writers.1.name", "'colmap' supports only a global shutter"],
        ),
        (
            MINIMAL + "joints: {panel: sun-tracking}\nwriters: [coco, nerfstudio]\n",
            ["line 7", "writers.1.name", "'nerfstudio' supports only rigid spacecraft, and joints is"],
        ),
        (MINIMAL + "sensor: {exposure_s: .nan}\n", ["sensor.exposure_s", "nan"]),
        (MINIMAL + "sensor: {exposure_s: -1}\n", ["sensor.exposure_s", "-1"]),
        (MINIMAL + "relative: {roe_m: [1, 2]}\n", ["relative.roe_m"]),
        (MINIMAL + "relative: {}\n", ["relative", "exactly one of"]),
        (MINIMAL + "times: {count: 0}\n", ["times.count"]),
        (MINIMAL + "times: {t_s: [1], count: 3}\n", ["times", "count and rate_hz go with a duration"]),
        (MINIMAL + "annotators: [box, box]\n", ["annotators", "'box' is given twice"]),
        (MINIMAL + "annotators: [boxx]\n", ["annotators.0.name", "'boxx'", "did you mean 'box'"]),
        (MINIMAL.replace("aqua", "acqua"), ["line 1", "target.name", "did you mean 'aqua'"]),
        (MINIMAL.replace("orbit:", "orbits:"), ["orbits", "did you mean 'orbit'"]),
        (MINIMAL.replace("a_m: 7123931.35", "a_m: seven"), ["orbit.elements.a_m", "'seven'"]),
        ("target: {}\norbit: {}\n", ["target", "exactly one of name, mesh, package"]),
        ("orbit: {tle: [a, b]}\n", ["target", "missing"]),
    ],
)
def test_bad_text_is_named_in_one_line(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_an_option_is_named_as_the_option_it_was(tmp_path):
    with pytest.raises(InputError, match=r"^option camera\.width_px: .*-5"):
        load(tmp_path, MINIMAL, **{"camera.width_px": -5})
    with pytest.raises(InputError, match="write it as key=value"):
        parse_override("camera.width_px")
    assert parse_override("times.t_s=[0, 1e1]") == ("times.t_s", [0, 10.0])


def test_unknown_scenario_names_the_nearest():
    with pytest.raises(InputError, match=r"'aqa'; did you mean 'aqua'\?.*cluster"):
        load_scenario("aqa", REGISTRY)
    with pytest.raises(InputError, match=r"no_such\.yaml: cannot be read"):
        load_scenario("no_such.yaml", REGISTRY)


def test_times_by_count_include_both_ends(tmp_path):
    times = load(tmp_path, MINIMAL + "times: {duration_s: 10, count: 5}\n").times
    assert times.seconds(lambda: pytest.fail("no orbit is asked for")).tolist() == [0, 2.5, 5, 7.5, 10]
    orbits = load(tmp_path, MINIMAL + "times: {count: 3}\n").times
    assert orbits.seconds(lambda: 8.0).tolist() == [0, 4, 8]


_scalars = st.one_of(
    st.integers(-(10**9), 10**9),
    st.floats(allow_nan=False, allow_infinity=False),
    st.booleans(),
    st.none(),
    st.text(st.characters(codec="ascii", categories=["L", "N"]), max_size=8),
)
_keys = st.text("abcdefgh_", min_size=1, max_size=6)
_documents = st.dictionaries(
    _keys,
    st.recursive(
        _scalars,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_keys, inner, max_size=3),
        max_leaves=8,
    ),
    max_size=4,
)


@given(_documents)
def test_what_a_standard_yaml_writer_writes_is_read_back(document):
    assert YamlText(yaml.safe_dump(document), "t").value == document


@given(st.text(max_size=200))
def test_no_text_ends_in_anything_but_an_input_error(text):
    with contextlib.suppress(InputError):
        YamlText(text, "t")


def test_files_of_the_attitude_are_beside_the_scenario(tmp_path):
    laws = "attitude: {target: {law: file, path: a.aem}, camera: {law: file, path: /b.npz}}\n"
    attitude = load(tmp_path, MINIMAL + laws).attitude
    assert attitude.target.options["path"] == tmp_path / "a.aem"
    assert attitude.camera.options["path"] == Path("/b.npz")


def test_a_camera_by_name_gives_camera_and_sensor(tmp_path):
    scenario = load(tmp_path, MINIMAL + "camera: {preset: speed-plus}\nsensor: {noise: {read_e: 3}}\n")
    camera = scenario.camera.camera()
    # camera.json of SPEED+: fx = 17.5131 mm, fy = 17.5117 mm, pixels of 5.86 µm, K and distCoeffs.
    assert camera.pixel_pitch_m == pytest.approx(5.86e-6)
    assert camera.focal_length_m == pytest.approx(0.017513075965995915, rel=1e-12)
    assert camera.fy_px * camera.pixel_pitch_m == pytest.approx(0.017511673079277208, rel=1e-12)
    assert (camera.cx_px, camera.cy_px) == (960, 600)
    assert camera.distortion_coefficients[1] == 0.51409797089106379
    assert scenario.sensor.f_number == 16
    assert scenario.sensor.noise.read_e == 3  # written ones stay
    assert scenario.sensor.noise.dark_e_s == 4
    (tmp_path / "dumped.yaml").write_text(dump_scenario(scenario))
    assert load_scenario(str(tmp_path / "dumped.yaml"), REGISTRY) == scenario


@pytest.mark.parametrize("name", PRESETS)
def test_a_camera_by_name_is_that_of_a_scenario(tmp_path, name):
    scenario = load(tmp_path, MINIMAL + f"camera: {{preset: {name}}}\n")
    assert preset_camera(name) == scenario.camera.camera()


def test_a_camera_of_no_known_name_is_refused():
    with pytest.raises(InputError, match="no camera named 'sped'; did you mean 'speed'"):
        preset_camera("sped")


CALIBRATED = (
    "camera: {width_px: 1920, height_px: 1200, focal_px: [2988.6, 2988.3], centre_px: [955.2, 611.7],"
    " sensor_width_mm: 11.25, line_time_s: 1.0e-5, distortion: [-0.2, 0.1, 0.001, 0, 0]}\n"
    "sensor: {full_well_e: 32500, gain_e_dn: 130}\n"
)


def dn_s(scenario) -> float:
    """The DN per second of a pixel that sees a uniform radiance."""
    camera, keys = scenario.camera.camera(), scenario.sensor
    full_well_e = keys.full_well_e or FULL_WELL_E_M2 * camera.pixel_pitch_m**2
    electrons_s = ImageSensor(keys, camera).electrons_s(np.full(3, 10.0))
    return electrons_s[0] / (keys.gain_e_dn or full_well_e / 255)


@pytest.mark.parametrize(
    "camera", [CALIBRATED, "camera: {preset: speed-plus}\n", "camera: {preset: thesis}\n"]
)
def test_a_camera_at_another_scale_sees_the_same(tmp_path, camera):
    full, small = (load(tmp_path, MINIMAL + camera, **{"camera.scale": s}) for s in (1, 0.25))
    one, other = full.camera.camera(), small.camera.camera()
    assert (other.width_px, other.height_px) == (one.width_px // 4, one.height_px // 4)
    for share in ([0, 0], [1, 0], [0.3, 0.8], [1, 1]):  # of the image's width and height
        position = [np.array(share) * [c.width_px, c.height_px] - 0.5 for c in (one, other)]
        assert other.rays(position[1]) == pytest.approx(one.rays(position[0]), abs=1e-12)
    assert other.focal_length_m == pytest.approx(one.focal_length_m)
    assert other.line_time_s * other.height_px == pytest.approx(one.line_time_s * one.height_px)
    assert dn_s(small) == pytest.approx(dn_s(full))
    if full.sensor.full_well_e is not None:
        assert small.sensor.full_well_e == pytest.approx(16 * full.sensor.full_well_e)
    (tmp_path / "dumped.yaml").write_text(dump_scenario(small))
    assert load_scenario(str(tmp_path / "dumped.yaml"), REGISTRY) == small
    back = load_scenario(str(tmp_path / "dumped.yaml"), REGISTRY, {"camera.scale": 4})
    assert back.camera.camera().rays([[3.0, 5.0]]) == pytest.approx(one.rays([[3.0, 5.0]]), abs=1e-12)


def test_an_equidistant_camera_has_its_field_of_view(tmp_path):
    keys = "camera: {hfov_deg: 120, distortion_model: fisheye, distortion: [0, 0, 0, 0]}\n"
    camera = load(tmp_path, MINIMAL + keys).camera.camera()
    left, right = camera.rays([[-0.5, camera.cy_px], [camera.width_px - 0.5, camera.cy_px]])
    assert np.degrees(np.arctan(right[0]) - np.arctan(left[0])) == pytest.approx(120)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("distortion_model: fisheye", ["camera.distortion:", "[0, 0, 0, 0] is the equidistant one"]),
        ("distortion_model: fisheye, distortion: [0, 0, 0]", ["camera.distortion:", "has 4 coeff"]),
        ("distortion_model: omni, distortion: [0]", ["camera.distortion_model:", "'fisheye'"]),
        ("distortion: [0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]", ["camera.distortion:", "thin prisms"]),
        ("hfov_deg: 150, distortion_model: fisheye, distortion: [0, 0, 0, 0]", ["84.3 degrees"]),
    ],
)
def test_coefficients_that_are_not_the_lens_s(tmp_path, keys, words):
    with pytest.raises(InputError) as refused:
        load(tmp_path, MINIMAL + f"camera: {{{keys}}}\n")
    for word in ("line 6", *words):
        assert word in str(refused.value)


def test_writers_of_rational_lenses(tmp_path):
    lens = "camera: {distortion: [0, 0, 0, 0, 0, 0.1, 0, 0]}\nwriters: [colmap, NAME]\n"
    load(tmp_path, MINIMAL + lens.replace("NAME", "opencv-calibration"))
    for name in ("kalibr", "nerfstudio"):
        with pytest.raises(
            InputError, match=rf"writers\.1\.name: '{name}' supports only lenses without"
        ):
            load(tmp_path, MINIMAL + lens.replace("NAME", name))


def test_the_scale_of_a_camera_beside_is_its_own(tmp_path):
    beside = (
        "sensors: {wide: {type: camera, camera: {preset: speed, scale: 0.5}, sensor: {exposure_s: 1}}}\n"
    )
    options = load(tmp_path, MINIMAL + beside).sensors["wide"].options
    assert (options["camera"]["width_px"], options["camera"]["height_px"]) == (960, 600)
    assert options["sensor"]["full_well_e"] == pytest.approx(4 * 32500)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ({"width_px": 612}, ["camera.centre_px", "343.7 px outside", "use scale", "off_axis: true"]),
        ({"height_px": 400}, ["camera.centre_px", "tenth of its height of 400 px"]),
        ({"scale": 0.31875}, ["camera.scale", "612 x 382.5 px", "0.31666667 makes 608 x 380"]),
        ({"scale": 1e-9}, ["camera.scale", "0.0041666667 makes 8 x 5"]),
        ({"scale": 20}, ["camera.scale", "at most 16384"]),
        ({"scale": 0}, ["camera.scale", "greater than 0"]),
        ({"scale": "half"}, ["camera.scale", "'half'"]),
    ],
)
def test_a_calibrated_camera_of_another_size_is_not_cut_by_mistake(tmp_path, override, words):
    given = {f"camera.{key}": value for key, value in override.items()}
    with pytest.raises(InputError) as refused:
        load(tmp_path, MINIMAL + CALIBRATED, **given)
    for word in words:
        assert word in str(refused.value)


def test_a_part_of_a_larger_image_is_had_by_asking_for_it(tmp_path):
    near = load(tmp_path, MINIMAL + CALIBRATED, **{"camera.width_px": 900}).camera.camera()
    assert near.cx_px == 955.2  # a little outside
    far = {"camera.width_px": 612, "camera.off_axis": True}
    assert load(tmp_path, MINIMAL + CALIBRATED, **far).camera.camera().cx_px == 955.2


def test_a_camera_named_by_option_replaces_the_scenario_s(tmp_path):
    named = load(tmp_path, MINIMAL + CALIBRATED, **{"camera.preset": "thesis", "camera.width_px": 640})
    assert (named.camera.width_px, named.camera.height_px) == (640, 960)
    assert named.camera.hfov_deg == 90
    assert named.camera.distortion is None


def test_the_field_of_a_named_camera_can_be_another(tmp_path):
    camera = load(tmp_path, MINIMAL + "camera: {preset: speed, hfov_deg: 20}\n").camera.camera()
    assert camera.fx_px == pytest.approx(960 / np.tan(np.radians(10)))
    assert (
        load(tmp_path, MINIMAL + "camera: {preset: thesis}\n").camera.camera()
        == load(tmp_path, MINIMAL).camera.camera()
    )
    flat = load(tmp_path, MINIMAL + "camera: {preset: speed-plus, distortion: null}\n").camera.camera()
    assert flat.distortion is None


def test_cameras_are_described_by_name():
    said = CliRunner().invoke(describe, ["camera", "speed-plus", "--json"])
    value = json.loads(said.output)
    assert value["camera"]["distortion"][0] == -0.22383016606510672
    assert value["sensor"]["full_well_e"] == 32500
    assert "Park et al. 2022" in value["source"]
    text = CliRunner().invoke(describe, ["camera", "speed"]).output
    assert "sensor_width_mm: 11.2512" in text
    for arguments, words in (
        (["camera", "sped"], "did you mean 'speed'"),
        (["camera"], "thesis, speed"),
    ):
        with pytest.raises(InputError, match=words):
            CliRunner().invoke(describe, arguments, catch_exceptions=False)


ARM = """
joints: {wing: sun-tracking}
bodies:
  arm:
    spacecraft: arm
    mount: {position_m: [1, 0, 1]}
    joints: {elbow: random, wrist: {law: rate, rate_deg_s: 2}}
  other:
    spacecraft: {name: fragment, seed: 4}
    relative: {roe_m: [0, 0, 9, 0, 9, 0]}
    attitude: spin
"""


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("joints.wing.law", "fixed", {"law": "fixed", "value_deg": None, "value_m": None}),
        ("bodies.arm.joints.elbow.every", "run", {"law": "random", "every": "run"}),
        ("bodies.arm.joints.wrist.law", "fixed", {"law": "fixed", "value_deg": None, "value_m": None}),
        ("bodies.arm.joints.wrist.start_deg", 5, {"rate_deg_s": 2, "start_deg": 5}),
        ("bodies.other.attitude.rate_rpm", 3, {"law": "spin", "rate_rpm": 3}),
        ("bodies.other.spacecraft.size_m", 0.7, {"name": "fragment", "seed": 4, "size_m": 0.7}),
        ("bodies.other.spacecraft.name", "cubesat", {"name": "cubesat", "panel_angle_deg": 0}),
        ("bodies.arm.spacecraft.length_m", 2, {"name": "arm", "length_m": 2}),
    ],
)
def test_keys_of_joints_and_bodies_are_overridden(tmp_path, key, value, expected) -> None:
    """A component that is given by its name alone gets the option; another name drops the former's."""
    found = load(tmp_path, MINIMAL + ARM, **{key: value}).model_dump(mode="json")
    for step in key.split(".")[:-1]:
        found = found[step]
    assert {name: found[name] for name in expected} == expected


def test_so_many_relative_orbits_that_they_do_not_fit_into_memory_are_refused(tmp_path):
    many = {"propagator.name": "thesis", "propagator.relative_orbits": 100_000}
    with pytest.raises(InputError, match=r"propagator\.relative_orbits: .*less than or equal to 10000"):
        load(tmp_path, MINIMAL, **many)
