"""The page of a flight: what is in it, and what a real browser makes of it."""

import json
import re
from dataclasses import replace

import cv2
import flights
import numpy as np
import pytest
from browser import opened
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from small_run import BOX_OBJ

import posse_core as posse
from posse_core._errors import InputError
from posse_core._evaluation.flight import flight_errors, summarise
from posse_core._view.flight.columns import as_numbers, cone_points, time_plots
from posse_core._view.flight.page import write_flight_page

EVERY = 6
MIB = 2**20


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Sixteen frames of an approach, and the flight's record. Tests must not change them."""
    pytest.importorskip("posse_render_raster")
    folder = tmp_path_factory.mktemp("flown")
    (folder / "box.obj").write_text(BOX_OBJ)
    motion = flights.approach()
    scenario = folder / "scenario.yaml"
    scenario.write_text(json.dumps(flights.scenario(motion, EVERY)))
    dataset = posse.run(scenario, folder / "d")
    # The page's checks of the estimate need it to differ from the truth by pixels.
    return dataset, flights.flight_record(flights.as_flown(motion, dataset.trajectory), error_scale=2.0)


@pytest.fixture(scope="module")
def page(flown):
    dataset, record = flown
    path = dataset.folder / "flight.html"
    written = write_flight_page(dataset, record, path)
    assert written.frames == written.previews == len(record)
    assert written.size_bytes == path.stat().st_size
    return path


def block(path, name):
    return json.loads(re.search(rf'id="{name}">(.*?)</script>', path.read_text(), re.DOTALL)[1])


def camera_pose(trajectory, i, r_rtn_m, q_eci_from_body):
    """Attitude and position in the camera, by SciPy and by the orbit's own axes."""
    r, v = trajectory.r_target_eci_m[i], trajectory.v_target_eci_m_s[i]
    normal = np.cross(r, v)
    radial, normal = r / np.linalg.norm(r), normal / np.linalg.norm(normal)
    axes = np.column_stack([radial, np.cross(normal, radial), normal])
    to_cam = Rotation.from_quat(trajectory.q_eci_from_camera[i][[1, 2, 3, 0]]).inv()
    return to_cam * Rotation.from_quat(q_eci_from_body[[1, 2, 3, 0]]), to_cam.apply(-axes @ r_rtn_m)


def test_true_poses_are_those_of_the_labels(flown, page):
    dataset, _ = flown
    for i, labels in enumerate(dataset):
        pose = block(page, f"frame-{i}")["poses"]["true"]
        assert pose["t"] == pytest.approx(labels.t_body_cam_m, rel=1e-5, abs=1e-4)
        assert abs(np.dot(pose["q"], labels.q_cam_from_body)) == pytest.approx(1, abs=1e-6)


def test_estimated_and_single_poses_are_put_before_the_camera(flown, page):
    dataset, record = flown
    seen = 0
    for i in range(len(record)):
        poses = block(page, f"frame-{i}")["poses"]
        for name, r, q in (
            ("estimate", record.r_rtn_m[i], record.q_eci_from_body[i]),
            ("single", record.r_single_rtn_m[i], record.q_single_eci_from_body[i]),
        ):
            if np.isnan(r).any():
                assert poses[name] is None
                continue
            rotation, t = camera_pose(dataset.trajectory, i, r, q)
            assert poses[name]["t"] == pytest.approx(t, rel=1e-4, abs=1e-4)
            drawn = Rotation.from_quat(np.array(poses[name]["q"])[[1, 2, 3, 0]])
            assert (rotation.inv() * drawn).magnitude() < 1e-4
            seen += 1
    assert seen == 2 * len(record) - flights.FIRST_ESTIMATE - 2


def test_the_figures_are_those_of_the_summary(flown, page):
    dataset, record = flown
    summary = summarise(record, dataset.spacecraft.symmetries)
    figures = dict(block(page, "flight")["figures"])
    scale = {"m": 1, "mm": 1e-3, "m/s": 1, "mm/s": 1e-3, "×": 1, "%": 0.01, "s": 1, "": 1}

    def read(name):
        number, unit = re.fullmatch(r"(-?[\d.]+) ?(.*?)(?: of frames)?", figures[name]).groups()
        return float(number) * scale[unit]

    assert read("Duration") == record.t_s[-1]
    start, end = figures["Range, start to end"].split(" → ")
    assert start == f"{np.linalg.norm(flights.START_M):.0f} m"
    assert end == f"{summary.final_range_m:.1f} m"
    for name, value in (
        ("Closest approach", summary.closest_m),
        ("Final distance from the waypoint", summary.final_position_error_m),
        ("Final velocity error", summary.final_velocity_error_m_s),
        ("95 % of the time held, position within", summary.position_error_95_m),
        ("95 % of the time held, velocity within", summary.velocity_error_95_m_s),
        ("Δv", summary.dv_m_s),
        ("Δv over the least possible", summary.dv_m_s / summary.least_dv_m_s),
        ("Estimate's position error, median", summary.median_position_error_m),
        ("Single frames' position error, median", summary.median_single_position_error_m),
        ("Estimate's at the same frames", summary.median_paired_position_error_m),
        ("Estimate's position error at the end", summary.final_estimate_position_error_m),
        ("Estimate's velocity error at the end", summary.final_estimate_velocity_error_m_s),
        ("Rate error at the end", summary.rate_error),
        ("NEES in its 95 % band", summary.nees_share),
        ("NEES at the end", summary.nees_final),
        ("Longest time lost", summary.lost_s),
    ):
        assert read(name) == pytest.approx(value, rel=6e-3), name
    degrees = float(figures["Attitude error at the end"].removesuffix("°"))
    assert np.radians(degrees) == pytest.approx(summary.attitude_error_rad, rel=6e-3)
    assert figures["Keep-out ellipsoid"] == "not entered"


def test_plots_are_in_the_units_they_name(flown):
    _, record = flown
    errors = flight_errors(record)
    plots = {plot.title: plot for plot in time_plots(record, errors)}
    assert len(plots) == 18
    last = {title: plot.values[-1] for title, plot in plots.items()}
    assert last["Position error, T"] == record.r_true_rtn_m[-1, 1] - record.r_rtn_m[-1, 1]
    velocity = record.v_true_rtn_m_s[-1, 2] - record.v_rtn_m_s[-1, 2]
    assert last["Velocity error, N"] == pytest.approx(1e3 * velocity)
    assert last["Attitude error, x"] == pytest.approx(np.degrees(errors.attitude_rad[-1, 0]))
    assert plots["Velocity error, N"].band[-1] == pytest.approx(
        np.array([-3e3, 3e3]) * np.sqrt(record.covariance[-1, 5, 5])
    )
    for title, dof, frame in (
        ("NEES of position and velocity", 6, 4),
        ("NEES with attitude and rate", 12, 4),
    ):
        assert plots[title].band[frame] == pytest.approx(chi2.interval(0.95, dof))
    nis = plots["NIS over its degrees of freedom"]
    assert nis.values[4] == record.nis[4] / record.dof[4]
    assert nis.band[4] * record.dof[4] == pytest.approx(chi2.interval(0.95, record.dof[4]))
    assert np.isnan(nis.values[0])
    assert np.isnan(nis.band[0]).all()
    assert last["Δv so far"] == pytest.approx(1e3 * np.linalg.norm(record.dv_rtn_m_s, axis=1).sum())


def test_what_was_not_estimated_has_no_plot(flown, tmp_path):
    dataset, record = flown
    covariance = np.full_like(record.covariance, np.nan)
    covariance[:, :6, :6] = record.covariance[:, :6, :6]
    nothing = np.full_like(record.q_eci_from_body, np.nan)
    bare = replace(
        record,
        q_eci_from_body=nothing,
        omega_body_rad_s=nothing[:, :3],
        covariance=covariance,
        keep_out_m=np.full(3, np.nan),
        cone=np.full(5, np.nan),
    )
    path = tmp_path / "flight.html"
    write_flight_page(dataset, bare, path)
    flight = block(path, "flight")
    titles = [plot["title"] for plot in flight["plots"]]
    assert len(titles) == 11
    assert not any("ttitude" in title for title in titles)
    assert flight["keep_out_m"] is None
    assert flight["cone_rtn_m"] is None
    pose = block(path, "frame-5")["poses"]["estimate"]
    assert pose["q"] is None
    assert len(pose["t"]) == 3
    assert dict(flight["figures"])["Attitude error at the end"] == "–"


def test_the_cone_has_its_angle_and_length():
    axis = np.array([0.6, 0.0, -0.8])
    apex, *rim = cone_points(np.array([*axis, 0.3, 25.0]))
    assert apex == pytest.approx([0, 0, 0])
    assert np.linalg.norm(rim, axis=1) == pytest.approx(np.full(len(rim), 25.0))
    assert rim @ axis == pytest.approx(np.full(len(rim), 25 * np.cos(0.3)))
    assert np.mean(rim, axis=0) == pytest.approx(25 * np.cos(0.3) * axis)


def test_numbers_that_are_missing_are_null():
    assert as_numbers(np.array([[1.23456789, np.nan], [np.inf, 0.0]])) == [[1.23457, None], [None, 0.0]]
    assert as_numbers(None) is None


def test_a_page_stays_within_its_limit(flown, page, tmp_path):
    dataset, record = flown
    whole = page.stat().st_size
    limit = whole - 8000
    small = write_flight_page(dataset, record, tmp_path / "small.html", max_bytes=limit)
    assert (tmp_path / "small.html").stat().st_size == small.size_bytes <= limit
    assert 0 < small.previews < len(record)
    with pytest.raises(InputError, match="take fewer frames"):
        write_flight_page(dataset, record, tmp_path / "none.html", max_bytes=20_000)
    assert not (tmp_path / "none.html").exists()


def test_a_record_of_another_flight_is_refused(flown, tmp_path):
    dataset, record = flown
    with pytest.raises(InputError, match="has 16 frames, but the record of the flight 15"):
        write_flight_page(dataset, flights.rows(record, slice(0, 15)), tmp_path / "p.html")


def test_the_page_names_no_address(page):
    assert not re.findall(r"(?:src|href)=", page.read_text().split("<script>")[0])
    assert "default-src 'none'" in page.read_text()


TELL = """
    told.figures = [...document.querySelectorAll("#figures div")].map((entry) =>
      [entry.querySelector("dt").textContent, entry.querySelector("dd").textContent]);
    told.start = [state.current, location.hash, byId("scrub").value];
    const marker = (plot) => {
      const context = plot.canvas.getContext("2d"), row = Math.round(plot.top) + 1, found = [];
      const data = context.getImageData(0, row, plot.canvas.width, 1).data;
      for (let i = 0; i < data.length; i += 4)
        if (Math.min(...data.slice(i, i + 4)) > 150) found.push(i / 4);
      return [found, plot.x(t_s[state.current]), plot.left, plot.right];
    };
    told.markers = [];
    for (const place of [3, 12]) {
      byId("scrub").value = place;
      byId("scrub").oninput({ target: byId("scrub") });
      picture.draw();
      drawPlots();
      told.markers.push([state.current, location.hash, plots.map(marker), plots[0].readout.textContent,
        projections.map((projection) => projection.canvas.getAttribute("aria-label")),
        byId("facts").textContent, plots[0].canvas.getAttribute("aria-label")]);
    }
    told.wires = columns.index.map((_, place) => {
      const { estimate } = frameAt(place).poses;
      return estimate && wireOf(estimate);
    });
    told.ellipses = projections.map((projection) => {
      const pixels = projection.ellipse(12), [a, b] = projection.centre, [x, y] = projection.middle;
      return pixels.map(([u, v]) => [(u - x) / projection.scale + a, b - (v - y) / projection.scale]);
    });
    told.range = [plots[0].low, plots[0].high];
    showPart(1300, 1700);
    drawPlots();
    told.part = [plots[0].low, plots[0].high, plots[0].x(1300), plots[0].left, byId("whole").hidden];
    byId("whole").click();
    told.whole = [part.from, part.to];
    told.hidden = byId("whole").hidden;
    location.hash = "#frame=7";
    window.onhashchange();
    told.addressed = state.current;
    document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "End", bubbles: true }));
    told.last = state.current;
"""


@pytest.fixture(scope="module")
def told(browse, page):
    return browse(page, TELL, "#frame=5")


def test_it_opens_at_the_frame_of_its_address(told):
    assert told["errors"] == []
    assert told["start"] == [5, "#frame=5", "5"]
    assert told["addressed"] == 7
    assert told["last"] == 15


def test_the_heading_shows_the_figures(told, page):
    assert told["figures"] == block(page, "flight")["figures"]


def test_the_slider_moves_through_all_plots(told, flown):
    _, record = flown
    for place, (current, address, markers, readout, labels, facts, label) in zip(
        (3, 12), told["markers"], strict=True
    ):
        assert current == place
        assert address == f"#frame={place}"
        assert len(markers) == 18
        for found, x, left, right in markers:
            share = record.t_s[place] / record.t_s[-1]
            assert x == pytest.approx(left + share * (right - left))
            assert found
            assert np.mean(found) == pytest.approx(x - 0.5, abs=1)
        error = record.r_true_rtn_m[place, 0] - record.r_rtn_m[place, 0]
        assert float(readout.split(",")[0]) == pytest.approx(error, rel=1e-3)
        assert readout in label
        assert f"{record.t_s[place]:.1f} s" in facts
        for text, pair in zip(labels, ((1, 0), (1, 2), (2, 0)), strict=True):
            found = [float(number) for number in re.findall(r"(-?[\d.e-]+) m", text)]
            expected = [record.r_true_rtn_m[place, axis] for axis in pair]
            assert found == pytest.approx(expected, rel=1e-3, abs=1e-3)


def test_the_estimates_lines_are_where_opencv_projects_them(told, flown):
    """The mesh has no skeleton: the lines are the twelve edges of its box."""
    dataset, record = flown
    for i, wire in enumerate(told["wires"]):
        if i < flights.FIRST_ESTIMATE:
            assert wire is None
            continue
        rotation, t = camera_pose(dataset.trajectory, i, record.r_rtn_m[i], record.q_eci_from_body[i])
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij")).reshape(3, -1).T
        corners = signs * [1.0, 0.5, 0.5]
        expected, _ = cv2.projectPoints(
            corners, rotation.as_rotvec(), t, dataset.camera.matrix, np.zeros(5)
        )
        edges = [
            (expected[a, 0], expected[b, 0])
            for a in range(8)
            for b in range(8)
            if a < b and np.abs(signs[a] - signs[b]).sum() == 2
        ]
        assert len(wire) == 12
        drawn = sorted(sorted(map(tuple, edge)) for edge in wire)
        wanted = sorted(sorted(map(tuple, edge)) for edge in np.array(edges).tolist())
        assert np.array(drawn) == pytest.approx(np.array(wanted), abs=0.02)


def test_ellipses_are_those_of_three_sigma(told, flown):
    _, record = flown
    for points, pair in zip(told["ellipses"], ((1, 0), (1, 2), (2, 0)), strict=True):
        off = np.array(points) - record.r_rtn_m[12][list(pair)]
        P = record.covariance[12][np.ix_(pair, pair)]
        distance = np.einsum("fi,ij,fj->f", off, np.linalg.inv(P), off)
        assert distance == pytest.approx(np.full(len(points), 9.0), rel=1e-3)


def test_a_part_of_the_flight_is_shown_larger(told):
    low, high, x, left, hidden = told["part"]
    assert high - low < 0.7 * (told["range"][1] - told["range"][0])
    assert x == pytest.approx(left)
    assert not hidden
    assert told["whole"] == [0, 1800]
    assert told["hidden"]


def test_a_flight_without_attitude_and_limits_is_drawn_too(browse, flown, tmp_path):
    """No estimate at all, no impulse, no waypoint: nothing fails."""
    dataset, record = flown
    everywhere, none = slice(None), np.empty((0, 3))
    bare = flights.without_readings(flights.without_estimate(record, everywhere), everywhere)
    bare = replace(
        bare,
        dv_rtn_m_s=np.zeros_like(bare.dv_rtn_m_s),
        t_waypoint_s=none[:, 0],
        until_waypoint_s=none[:, 0],
        r_waypoint_rtn_m=none,
        v_waypoint_rtn_m_s=none,
        keep_out_m=np.full(3, np.nan),
        cone=np.full(5, np.nan),
        least_dv_m_s=np.array(np.nan),
    )
    path = tmp_path / "flight.html"
    write_flight_page(dataset, bare, path)
    found = browse(
        path, 'byId("next").click(); told.plots = plots.map((plot) => plot.title); drawPlots();'
    )
    assert found == {"errors": [], "plots": ["Range", "Impulse", "Δv so far"]}


def test_a_drag_across_a_plot_shows_this_part_of_the_flight(page, flown, tmp_path):
    """By real events of the pointer, of which a drag has many."""
    t_s = flown[1].t_s
    with opened(page, tmp_path, height=2400) as tab:
        x, y, width, height = tab.place("#times canvas")
        left, right, low, high = tab.tell(
            "[52, byId('times').querySelector('canvas').clientWidth - MARGIN, part.from, part.to]"
        )
        assert (low, high) == (t_s[0], t_s[-1])
        shares = 0.3, 0.7
        at = [x + left + share * (right - left) for share in shares]
        tab.drag((at[1], y + height / 2), (at[0], y + height / 2))
        shown = tab.tell("[part.from, part.to]")
        expected = [low + share * (high - low) for share in shares]
        assert shown == pytest.approx(expected, abs=2 * (high - low) / width)
        assert tab.tell("byId('whole').hidden") is False
        tab.click(x + (left + right) / 2, y + height / 2)
        middle = tab.tell("t_s[state.current]")
        assert abs(middle - sum(expected) / 2) <= np.diff(t_s).max()
        tab.press("#whole")
        assert tab.tell("[part.from, part.to]") == [low, high]
        assert tab.errors == []
