"""The scenarios that come with the core; quick to import, for shells that complete names."""

from __future__ import annotations

from pathlib import Path
from typing import Final

BUILT_IN: Final = Path(__file__).with_name("built_in")
"""The folder of their files."""


def built_in_names() -> list[str]:
    """Names of the scenarios that come with the core."""
    return sorted(path.stem for path in BUILT_IN.glob("*.yaml"))
