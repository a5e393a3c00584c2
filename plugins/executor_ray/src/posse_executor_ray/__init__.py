"""A POSSE executor on Ray. Importing this module does not import ray."""

from __future__ import annotations

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_executors() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "ray",
            "makes frames in actors of a Ray cluster, each with its own renderer",
            "posse_executor_ray.executor:RayExecutor",
            "posse_core:PoolOptions",
        )
    ]
