"""The conformance class for renderers: light, lobes, geometry and sky against closed forms, bodies
that move, and behaviour."""

from __future__ import annotations

from posse_core.testing.finishes import FinishesConformance
from posse_core.testing.geometry import GeometryConformance
from posse_core.testing.light import LightConformance
from posse_core.testing.lobes import LobesConformance
from posse_core.testing.manners import MannersConformance
from posse_core.testing.sky import SkyConformance
from posse_core.testing.worlds import WorldsConformance


class RendererConformance(
    LightConformance,
    LobesConformance,
    GeometryConformance,
    FinishesConformance,
    WorldsConformance,
    SkyConformance,
    MannersConformance,
):
    """What every renderer must do; see ``posse_core.testing.stage.RendererStage``."""
