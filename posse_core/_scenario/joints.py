"""Scenario keys of joints: the laws that move them."""

from __future__ import annotations

from pydantic import Field

from posse_core._scenario.component import ComponentChoice


class JointLawChoice(ComponentChoice):
    """A joint's law, written as its name or as a mapping of ``law`` and the law's options."""

    name: str = Field(alias="law", description="name of the law; 'posse describe joint-law' lists them")
