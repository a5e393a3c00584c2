"""The documentation builds as a site without a warning, and shows what is public and installed."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import pytest

import posse_core
from posse_core._plugins.kinds import KINDS
from posse_core._plugins.loading import load_plugins

DOCS = Path(__file__).parents[1] / "docs"
_TARGET = re.compile(r'(?:href|src)="([^"]*)"')
_ID = re.compile(r'\bid="([^"]+)"')

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("sphinx") is None or importlib.util.find_spec("furo") is None,
    reason="needs posse-core[docs]",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as ``make docs`` builds it, where a warning is an error."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", str(folder / "trees")]
    done = subprocess.run(
        [*command, str(DOCS), str(folder / "html")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return folder / "html"


@pytest.mark.slow
def test_every_link_within_the_site_leads_somewhere(site: Path) -> None:
    pages = {path: path.read_text("utf-8") for path in site.rglob("*.html")}
    anchors = {path: set(map(unescape, _ID.findall(text))) for path, text in pages.items()}
    broken = []
    for path, text in pages.items():
        for target in set(map(unescape, _TARGET.findall(text))):
            if re.match(r"[a-z]+:", target):
                continue
            name, _, anchor = target.partition("#")
            name = unquote(name.partition("?")[0])
            found = (path.parent / name).resolve() if name else path
            if not found.is_file() or (anchor and found in anchors and anchor not in anchors[found]):
                broken.append(f"{path.relative_to(site)}: {target}")
    assert len(pages) > 60
    assert broken == []


@pytest.mark.slow
def test_every_public_name_and_component_has_its_place(site: Path) -> None:
    ids = set()
    for path in (site / "generated").glob("api-*.html"):
        ids |= set(_ID.findall(path.read_text("utf-8")))
    assert {f"posse_core.{name}" for name in posse_core.__all__ if name != "testing"} <= ids
    assert {f"posse_core.testing.{name}" for name in ("RendererConformance", "SensorConformance")} <= ids
    registry = load_plugins().registry
    for kind in ("renderer", "sensor", "detector", "writer"):
        page = (site / "generated" / f"kind-{kind}.html").read_text("utf-8")
        assert set(registry.names(kind)) <= set(_ID.findall(page))


@pytest.mark.slow
def test_what_flows_has_a_page_and_kinds_have_their_words(site: Path) -> None:
    """What an annotator gets and gives, and a record of each part of the way; the class of tests and the
    meaning of the capabilities on a kind's page."""
    rows = re.findall(
        r"<tr[^>]*>(.*?)</tr>", (site / "generated/api-flows.html").read_text("utf-8"), re.S
    )
    row_of = {found[1]: row for row in rows if (found := re.search(r'#posse_core\.(\w+)"', row))}
    passed_on = ("Motion", "Trajectory", "FrameState", "RenderRequest", "Radiance", "Frame", "LabelLine")
    assert {*passed_on, "Manifest", "Look", "Dataset", "Detection", "Estimate"} <= row_of.keys()
    assert "One instant as an annotator or a sensor looks at it" in unescape(row_of["Look"])
    assert {"kind-annotator.html", "kind-sensor.html"} & set(_TARGET.findall(row_of["Look"]))
    assert "kind-renderer.html" in row_of["Radiance"]
    for kind in KINDS.values():
        page = unescape((site / "generated" / f"kind-{kind.name}.html").read_text("utf-8"))
        assert kind.conformance.replace(":", ".") in page
        for capability in kind.capabilities.values():
            assert re.sub(r"\W+", " ", capability.claim) in re.sub(r"\W+", " ", page)
