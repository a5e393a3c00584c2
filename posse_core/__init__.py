"""POSSE: labelled, radiometric images of spacecraft, from an orbit to a dataset.

This package is the core. It imports no plugin and none of torch, bpy, mitsuba or OpenGL.
Start reading at :mod:`posse_core._plugins.hooks` (every extension point),
:mod:`posse_core._interfaces` (what a component must do) and
:mod:`posse_core._model` (the records that flow between components).
"""

__version__ = "0.1.0"
