"""An executor of POSSE on Ray. Importing this module imports no ray."""

from __future__ import annotations

from posse_core import ComponentSpec, hookimpl


@hookimpl
def posse_executors() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "ray",
            "actors of a Ray cluster, each with a renderer of its own",
            "posse_executor_ray.executor:RayExecutor",
            "posse_core:PoolOptions",
        )
    ]
