"""The core's own components, registered through the same hooks as a third party's."""

from __future__ import annotations

from posse_core.hookspecs import hookimpl
from posse_core.registry import ComponentSpec


@hookimpl
def posse_propagators() -> list[ComponentSpec]:
    return []


@hookimpl
def posse_scenes() -> list[ComponentSpec]:
    return []


@hookimpl
def posse_annotators() -> list[ComponentSpec]:
    return []


@hookimpl
def posse_writers() -> list[ComponentSpec]:
    return []


@hookimpl
def posse_executors() -> list[ComponentSpec]:
    return []
