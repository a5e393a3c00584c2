"""The viewer and the pages of results in headless Chromium, driven by real events."""

from __future__ import annotations

import cuboid
import cuboid_sensors
import numpy as np
import pytest
from browser import opened

from posse_core._evaluation.pages import Axis, Series, page, paragraph, plot, table

SETTLED = "new Promise((done) => setTimeout(done, 300))"


@pytest.fixture(scope="module")
def viewer(view, tmp_path_factory):
    """The page of six frames of a brick, with the readings of five sensors."""
    folder = cuboid.write_dataset(tmp_path_factory.mktemp("driven") / "d")
    cuboid_sensors.add_readings(folder)
    assert view(folder).exit_code == 0
    return folder / "view.html"


def on(tab, expression):
    """Left, top, width and height of an element that an expression gives."""
    return tab.tell(
        f"(({{ x, y, width, height }}) => [x, y, width, height])({expression}.getBoundingClientRect())"
    )


def test_frames_are_gone_through_by_keys_strip_and_buttons(viewer, tmp_path):
    with opened(viewer, tmp_path, height=1600) as tab:
        tab.tell(SETTLED)
        tab.key("ArrowRight", 39)
        assert tab.tell("state.current") == 1
        x, y, width, height = on(tab, "document.querySelectorAll('.thumb')[3]")
        tab.click(x + width / 2, y + height / 2)
        assert tab.tell("[state.current, location.hash]") == [3, "#frame=3"]
        tab.press("#previous")
        assert tab.tell("byId('go').value") == "2"
        tab.key("End", 35)
        assert tab.tell("state.current") == 5
        assert tab.errors == []


def test_the_image_zooms_at_the_pointer_and_a_double_click_shows_all_of_it(viewer, tmp_path):
    with opened(viewer, tmp_path, height=1600) as tab:
        tab.tell(SETTLED)
        x, y, width, height = tab.place("#picture")
        at = (0.7 * width, 0.4 * height)
        before = tab.tell(f"picture.screen.pixelAt({at[0]}, {at[1]})")
        tab.wheel(x + at[0], y + at[1], -400)
        assert tab.tell("picture.screen.zoom") == pytest.approx(np.e, rel=1e-6)
        assert tab.tell(f"picture.screen.pixelAt({at[0]}, {at[1]})") == pytest.approx(before, abs=0.5)
        tab.drag((x + at[0], y + at[1]), (x + at[0] - 40, y + at[1] + 20))
        moved = tab.tell(f"picture.screen.pixelAt({at[0] - 40}, {at[1] + 20})")
        assert moved == pytest.approx(before, abs=1)
        for count in (1, 2):
            tab.pointer("Pressed", x + 20, y + 20, button="left", clickCount=count)
            tab.pointer("Released", x + 20, y + 20, button="left", clickCount=count)
        assert tab.tell("picture.screen.zoom") == 1
        assert tab.errors == []


def test_a_drag_across_a_histogram_selects_frames(viewer, tmp_path):
    with opened(viewer, tmp_path, height=1900) as tab:
        tab.tell(SETTLED)
        x, y, width, height = on(tab, "document.querySelector('#plots canvas')")
        tab.drag((x + 2, y + height / 2), (x + width / 2, y + height / 2))
        tab.tell(SETTLED)
        kept = tab.tell("state.kept")
        ranges = tab.tell("columns.range_m")
        middle = (min(ranges) + max(ranges)) / 2
        assert kept == [i for i, value in enumerate(ranges) if value <= middle]
        assert 0 < len(kept) < 6
        tab.press("#clear")
        assert len(tab.tell("state.kept")) == 6
        assert tab.errors == []


def test_points_turn_with_the_pointer_and_zoom_at_it(viewer, tmp_path):
    with opened(viewer, tmp_path, height=1900) as tab:
        tab.tell(SETTLED)
        clouds = "sensors.tiles.map((tile) => tile.ways.cloud)"
        cloud = f"{clouds}.find((cloud) => cloud?.canvas.clientWidth)"
        x, y, width, height = on(tab, f"({cloud}).canvas")
        point = tab.tell(f"[...({cloud}).xyz.subarray(0, 3)]")
        seen = f"({cloud}).toCanvas({point})"
        start = tab.tell(seen)
        tab.wheel(x + start[0], y + start[1], -200)
        assert tab.tell(seen) == pytest.approx(start, abs=1)
        middle = (x + width / 2, y + height / 2)
        tab.drag(middle, (middle[0] + 30, middle[1] - 10), "shift")
        assert np.subtract(tab.tell(seen), start) == pytest.approx([30, -10], abs=2)
        yaw = tab.tell(f"({cloud}).yaw")
        tab.drag(middle, (middle[0] + 60, middle[1]))
        assert tab.tell(f"({cloud}).yaw") == pytest.approx(yaw - 0.5, abs=0.05)
        assert tab.errors == []


def test_a_page_of_results_is_no_wider_than_its_window(tmp_path):
    columns = [f"quantity number {i}, W/m²/sr" for i in range(40)]
    rows = [["aqua", *(f"{i / 7:.4g}" for i in range(40))], ["cluster", *["–"] * 40]]
    body = [
        paragraph("What was measured."),
        table(["", *columns], rows),
        table(("", ""), [("e_t", "position error divided by the range " * 4)]),
        plot("errors", Axis("range, m", 0, 30), Axis("error", 0, 1), [Series("aqua", [(1, 0.2)])]),
    ]
    path = tmp_path / "page.html"
    path.write_text(page("Results", "of a test", body), encoding="utf-8")
    with opened(path, tmp_path, width=800, height=600) as tab:
        assert tab.tell("[document.documentElement.scrollWidth <= innerWidth, document.compatMode]") == [
            True,
            "CSS1Compat",
        ]
        style = "getComputedStyle(document.querySelectorAll('{}')[{}]).textAlign"
        assert tab.tell(style.format("table:first-of-type td", 1)) == "right"
        assert (
            tab.tell("getComputedStyle([...document.querySelectorAll('td')].at(-1)).textAlign") == "left"
        )
        assert tab.errors == []
