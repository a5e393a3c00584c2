"""A component of an official plugin that is not installed: the message says what to install."""

import pytest

from posse_core._errors import InputError
from posse_core._plugins.kinds import RESERVED
from posse_core._plugins.loading import Plugins

OFFICIAL = [
    (distribution, kind, name)
    for distribution, reserved in RESERVED.items()
    for kind, names in reserved.items()
    if kind != "plugin"
    for name in names
]
BARE = Plugins(()).registry


def message(kind: str, name: str) -> str:
    with pytest.raises(InputError) as caught:
        BARE.spec(kind, name)
    return str(caught.value)


@pytest.mark.parametrize(("distribution", "kind", "name"), OFFICIAL)
def test_the_package_of_every_official_component_is_named(distribution, kind, name):
    said = message(kind, name)
    assert (
        f"no {kind} named {name!r}: it comes with {distribution}, so pip install {distribution}." in said
    )
    assert "did you mean" not in said


def test_a_misspelt_name_of_what_is_not_installed_leads_to_it_too():
    assert "did you mean 'mitsuba'? (pip install posse-render-mitsuba)" in message("renderer", "mitsba")
    assert "did you mean 'coco'? Installed: " in message("writer", "cocoo")


def test_a_plugin_that_is_there_but_disabled_need_not_be_installed(monkeypatch, posse_in, tmp_path):
    """Whatever the names of plugin and component have in common."""
    done = posse_in(
        tmp_path,
        *("describe", "renderer", "flat"),
        env={"POSSE_DISABLE_PLUGINS": "render_flat"},
    )
    assert done.returncode == 2
    assert "The plugin 'render_flat' was not loaded: disabled" in done.stderr
    assert "pip install" not in done.stderr
