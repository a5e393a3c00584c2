"""Scenario keys of the attitude: the laws by which the target and the camera are oriented."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from posse_core._errors import InputError
from posse_core._plugins.options import Options
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice

Subject = Literal["target", "camera"]
"""What an attitude law orients."""


class LawChoice(ComponentChoice):
    """An attitude law, written as its name or as a mapping of ``law`` and the law's options."""

    name: str = Field(
        alias="law", description="name of the law; 'posse describe attitude-law' lists them"
    )


class AttitudeConfig(Options):
    """The attitude laws of target and camera."""

    target: LawChoice = Field(
        LawChoice(law="nadir"),
        description="attitude law of the target: a name, or {law, options};"
        " 'posse describe attitude-law' lists laws, and 'posse describe attitude-law NAME' options",
    )
    camera: LawChoice = Field(
        LawChoice(law="track"), description="attitude law of the camera: a name, or {law, options}"
    )


def check_law(registry: Registry, choice: LawChoice, subject: Subject, where: str) -> None:
    """Check that there is such a law and that it is made for the subject.

    Args:
        registry: the components that are installed.
        choice: the law.
        subject: what it is to orient.
        where: of the key, for the message.

    Raises:
        InputError: The message names the key, the law, and the laws to use instead.
    """
    try:
        able = registry.spec("attitude-law", choice.name).capabilities
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if subject not in able:
        fit = [spec.name for spec in registry.specs("attitude-law") if subject in spec.capabilities]
        raise InputError(
            f"{where}: {choice.name!r} is not made for the {subject}; laws that are: {', '.join(fit)}"
        )
