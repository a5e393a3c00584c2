"""POSSE simulates rendezvous as a chaser sees it, from an orbit to labelled images and poses.

This package is the whole public interface of the core: what its ``__all__`` lists, and the conformance
kit in :mod:`posse_core.testing`. The names stand in ``__init__.pyi``; each is imported when it is first
used. Modules whose names begin with an underscore are private and change without notice.
"""

import os
from pathlib import Path

import lazy_loader

# OpenCV reads these once, when it is imported: the largest image that it decodes, since a damaged header
# of a few bytes may claim 2^30 pixels, its own limit; and no log, since POSSE reports bad images.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(16384**2))
os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")

__version__ = Path(__file__).with_name("VERSION").read_text("utf-8").strip()

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
