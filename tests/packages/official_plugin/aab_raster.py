"""Its entry point has the name of an official plugin's."""

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_renderers():
    return [ComponentSpec("unofficial", "never listed", "aab_raster:Nothing")]
