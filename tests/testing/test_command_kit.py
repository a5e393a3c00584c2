"""The kit of commands catches what it is there for."""

from __future__ import annotations

import click
import pytest

from posse_core.testing import CommandConformance

SAYS = "test_it_says_what_it_does"
OPTIONS = "test_options_are_written_as_all_are"
UNKNOWN = "test_an_unknown_option_is_refused"

LAMP = click.option("--lamp", help="Which lamp.")


class Broken(click.Command):
    def format_help(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        raise RuntimeError("no terminal")


def shine(**given: object) -> None:
    """Let a lamp shine."""


def silent(**given: object) -> None:
    pass


COMMANDS = {
    "nothing": (click.command("shine")(LAMP(shine)), {}),
    "no help": (click.command("shine")(LAMP(silent)), {SAYS: "give the function a docstring"}),
    "option without help": (
        click.command("shine")(click.option("--bulb")(shine)),
        {SAYS: "--bulb has no help"},
    ),
    "help that breaks": (
        Broken("shine", help="Let a lamp shine."),
        {SAYS: "ends with exit code 1"},
    ),
    "capitals": (
        click.command("shine")(click.option("--Lamp", "lamp", help="Which.")(shine)),
        {OPTIONS: "--Lamp has capitals"},
    ),
    "underscore": (
        click.command("shine")(click.option("--my_lamp", help="Which.")(shine)),
        {OPTIONS: "write --my-lamp"},
    ),
    "takes everything": (
        click.command("shine", context_settings={"ignore_unknown_options": True})(
            click.argument("rest", nargs=-1)(shine)
        ),
        {UNKNOWN: "ends with exit code 0, not 2"},
    ),
}


@pytest.mark.parametrize("wrong", COMMANDS)
def test_a_wrong_command_fails_for_its_own_reason(wrong: str) -> None:
    made, caught = COMMANDS[wrong]

    class Case(CommandConformance):
        def command(self) -> click.Command:
            return made

    for test in (name for name in vars(CommandConformance) if name.startswith("test_")):
        if test in caught:
            with pytest.raises(AssertionError, match=caught[test]):
                getattr(Case(), test)()
        elif not caught:
            getattr(Case(), test)()
