"""Limits of what a scenario may ask for."""

from __future__ import annotations

from typing import Final

MOST_FRAMES: Final = 500_000
"""The most frames of a run: planning keeps 2 kB of each in memory, and takes 0.25 ms."""
