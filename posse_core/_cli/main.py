"""The command ``posse``: finds its subcommands among the plugins and reports errors in one line."""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
import warnings
from collections.abc import Sequence
from itertools import pairwise
from typing import Final, TextIO

import click
from click.shell_completion import CompletionItem

from posse_core import __version__
from posse_core._cli.common import COMPLETING, STOPPED
from posse_core._errors import PosseError
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.options import nearest

SHOW_FAULTS: Final = "POSSE_SHOW_FAULTS"
"""Environment variable: if it is set, an error that nothing foresaw ends in Python's traceback, and
warnings of arithmetic are shown."""
_SHOWN: Final = 200
"""The most characters of such an error that the message repeats."""
_LONGEST: Final = 1200
"""The most characters of a message, beside the mark of what is left out."""
_END: Final = 400
"""So many of them are its end, where the way out stands."""


class _Commands(click.Group):
    """The subcommands of the registry. Listing them does not import them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return load_plugins().registry.names("subcommand")

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        registry = load_plugins().registry
        if cmd_name not in registry.names("subcommand"):
            return None
        command: click.Command = registry.load("subcommand", cmd_name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        names = self.list_commands(ctx)
        if args and not args[0].startswith("-") and args[0] not in names:
            ctx.fail(f"no command {args[0]!r}{nearest(args[0], names)}")
        if not ctx.resilient_parsing:  # a shell completes a line that is not written yet
            _check_empty(ctx, args)
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem[str]]:
        specs = load_plugins().registry.specs("subcommand")
        begun = [s for s in specs if s.name.startswith(incomplete)]
        items = [CompletionItem(spec.name, help=spec.summary) for spec in begun]
        return [*items, *click.Command.shell_complete(self, ctx, incomplete)]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        rows = [(spec.name, spec.summary) for spec in load_plugins().registry.specs("subcommand")]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def _check_empty(ctx: click.Context, args: Sequence[str]) -> None:
    """Check that no option or argument of a command is an empty text, as a shell's unset variable is."""
    for before, arg in pairwise(args):
        option, given, value = arg.partition("=") if arg.startswith("--") else (before, "=", arg)
        if given and not value.strip():
            what = option if option.startswith("-") else f"an argument after {before!r}"
            ctx.fail(f"{args[0]}: {what} is empty; give it a value, or leave it out")


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="posse")
def posse() -> None:
    """Labelled, radiometric images of spacecraft: from a TLE and a relative orbit to a dataset.

    Exit codes: 0 success, 1 a check failed, 2 bad input, 3 a component failed, 4 a fault of POSSE.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: runs a command and ends the process with its exit code."""
    sys.exit(_run(arguments))


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print what a warning says without the line of code that issued it."""
    _say(f"warning: {message}")


def _run(arguments: Sequence[str] | None) -> int:
    warnings.showwarning = _show_warning
    if not os.environ.get(SHOW_FAULTS):
        # NumPy's warnings of overflow and the like: the checks of results say in words what is wrong.
        warnings.filterwarnings("ignore", ".* encountered in ", RuntimeWarning)
    if COMPLETING in os.environ:
        from posse_core._cli.completion import know_shells

        know_shells()
    try:
        code = posse.main(arguments, prog_name="posse", standalone_mode=False)
        return code if isinstance(code, int) else 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help() if error.ctx else "")
        return 0
    except click.ClickException as error:
        path = error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else "posse"
        message = " ".join(error.format_message().split()).rstrip(".")
        _say(f"{message} (see '{path} --help')")
        return 2
    except PosseError as error:
        _say(str(error))
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        _say("stopped")
        return STOPPED
    except BrokenPipeError:  # the reader of our output has gone, as in 'posse plugins | head'
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if isinstance(error, OSError) and error.filename is not None:
            _say(f"{error.filename}: {error.strerror}; name another path, or make this one usable")
            return 2
        if os.environ.get(SHOW_FAULTS):
            raise
        _say_fault(error)
        return 4


def _say_fault(error: Exception) -> None:
    """Report an error that nothing foresaw, and keep its details in a file."""
    details = f"posse {__version__}, Python {sys.version}\n{sys.argv}\n\n"
    details += "".join(traceback.format_exception(error))
    try:
        descriptor, path = tempfile.mkstemp(prefix="posse-fault-", suffix=".txt")
        with os.fdopen(descriptor, "w", encoding="utf-8", errors="replace") as file:
            file.write(details)
        where = f"the details are in {path}: send it with your input to those who maintain POSSE"
    except OSError:  # the disk may be full
        where = f"set {SHOW_FAULTS}=1 to see the details, and send them to those who maintain POSSE"
    _say(f"this is a fault of POSSE ({type(error).__name__}: {str(error)[:_SHOWN]}); {where}")


def _say(message: str) -> None:
    """Print a message as one line. Of one that repeats a long value, beginning and end are shown."""
    line = " ".join(message.split())
    if len(line) > _LONGEST:
        line = f"{line[: _LONGEST - _END]} ... {line[-_END:]}"
    click.echo(f"posse: {line}", err=True)
