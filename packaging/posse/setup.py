"""Pins the core and the plugins to the version that all of POSSE has, which stands in one file."""

from pathlib import Path

from setuptools import setup

VERSION = Path(__file__).with_name("VERSION").read_text("utf-8").strip()
EXTRAS = {
    "mitsuba": [f"posse-render-mitsuba=={VERSION}"],
    "raster": [f"posse-render-raster=={VERSION}"],
    "blender": [f"posse-render-blender=={VERSION}"],
    "torch": [f"posse-detect-torch=={VERSION}"],
    "onnx": [f"posse-detect-onnx=={VERSION}"],
    "ray": [f"posse-executor-ray=={VERSION}"],
    "s3": [f"posse-core[s3]=={VERSION}"],
}

setup(
    install_requires=[f"posse-core=={VERSION}"],
    extras_require={**EXTRAS, "all": [needed for extra in EXTRAS.values() for needed in extra]},
)
