"""Mitsuba loads its libLLVM when it is imported, also if the scalar variant is tested first in the same
process, so the right library is set here."""

from posse_render_mitsuba.variants import choose, load_library

if _library := choose("auto").library:
    load_library(_library)
