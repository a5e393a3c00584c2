"""The conformance kit on Ray."""

from __future__ import annotations

import pytest

from posse_core import PoolOptions
from posse_core.testing import ExecutorConformance
from posse_executor_ray.executor import RayExecutor


@pytest.mark.slow
class TestRay(ExecutorConformance):
    def executor(self, workers: int) -> RayExecutor:
        return RayExecutor(PoolOptions(workers=workers))
