"""The conformance class for commands of the command line."""

from __future__ import annotations

from abc import abstractmethod

import click
from click.testing import CliRunner

from posse_core.testing.conformance import Conformance


class CommandConformance(Conformance):
    """What every subcommand must do. A subclass provides :meth:`command`."""

    @abstractmethod
    def command(self) -> click.Command:
        """The command."""

    def test_it_says_what_it_does(self) -> None:
        """``--help`` ends well, and has a sentence on the command and a line on each option."""
        command = self.command()
        done = CliRunner().invoke(command, ["--help"])
        assert done.exit_code == 0, f"--help ends with exit code {done.exit_code}: {done.output}"
        assert command.help, "it has no help; give the function a docstring"
        assert command.get_short_help_str(), "its help does not begin with a sentence for the list"
        for parameter in command.params:
            if isinstance(parameter, click.Option) and not parameter.hidden:
                assert parameter.help, f"{parameter.opts[0]} has no help; give it help='...'"

    def test_options_are_written_as_all_are(self) -> None:
        """``--long-words`` in lower case, since completion and documentation list them."""
        for parameter in self.command().params:
            for name in (*parameter.opts, *parameter.secondary_opts):
                if isinstance(parameter, click.Option):
                    assert name == name.lower() or len(name.lstrip("-")) == 1, f"{name} has capitals"
                    assert "_" not in name, f"{name} has an underscore; write {name.replace('_', '-')}"

    def test_an_unknown_option_is_refused(self) -> None:
        """With exit code 2, naming it, before anything is done."""
        done = CliRunner().invoke(self.command(), ["--no-such-option"])
        assert done.exit_code == 2, (
            f"--no-such-option ends with exit code {done.exit_code}, not 2; does the command take"
            " unknown options?"
        )
        assert "--no-such-option" in done.output, f"the error does not name the option: {done.output}"
