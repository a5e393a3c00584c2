"""An OpenGL context without a display."""

from __future__ import annotations

import moderngl

from posse_core import ComponentError

WAY_OUT = "install an EGL driver (Debian, Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri)"


def create_context() -> moderngl.Context:
    """An OpenGL 3.3 core context through EGL.

    Raises:
        ComponentError: there is no EGL, or no EGL driver that supports OpenGL 3.3.
    """
    try:
        return moderngl.create_context(require=330, standalone=True, backend="egl")  # type: ignore[arg-type]
    except Exception as error:  # the loader raises a bare Exception if anything is missing
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ComponentError(f"raster: no OpenGL 3.3 through EGL: {reason}; {WAY_OUT}") from None
