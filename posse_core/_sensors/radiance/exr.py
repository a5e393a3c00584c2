"""OpenEXR files, which programs for images of high dynamic range read."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from posse_core._arrays import AnyArray
from posse_core._errors import ComponentError


def exr(radiance_rgb: AnyArray) -> bytes:
    """The content of a file with an image (H, W, 3), float32 or float16, as channels R, G and B."""
    module = library()
    header = {"compression": module.ZIP_COMPRESSION, "type": module.scanlineimage}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.exr"
        module.File(header, {"RGB": radiance_rgb}).write(str(path))
        return path.read_bytes()


def library() -> Any:
    """The optional dependency that writes the files.

    Raises:
        ComponentError: It is not installed.
    """
    try:
        import OpenEXR
    except ImportError as error:
        raise ComponentError(
            f"OpenEXR cannot be imported ({error}), which writes EXR files; install it with 'pip install"
            " posse-core[radiance]', or leave out the sensor's formats"
        ) from None
    return OpenEXR
