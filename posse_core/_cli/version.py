"""``posse version``: prints the versions of POSSE, of Python and of the plugins."""

from __future__ import annotations

import platform

import click

from posse_core import __version__
from posse_core._plugins.loading import load_plugins


@click.command()
def command() -> None:
    """Print the versions of POSSE, of Python and of the installed plugins."""
    click.echo(f"posse {__version__}, Python {platform.python_version()}")
    for status in load_plugins().statuses[1:]:  # the first is the core
        state = "" if status.state == "ok" else f", {status.state}"
        click.echo(f"{status.dist} {status.version}{state}")
