"""Scalar and llvm are tested in one process, and Mitsuba loads a libLLVM when it is imported."""

from posse_render_mitsuba.variants import choose, load_library

if _library := choose("auto").library:
    load_library(_library)
