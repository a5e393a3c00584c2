"""``posse plugins``: lists the installed plugins with their state and components."""

from __future__ import annotations

from dataclasses import asdict

import click

from posse_core._cli.common import echo_json, echo_table
from posse_core._plugins.kinds import KINDS
from posse_core._plugins.loading import load_plugins


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def command(as_json: bool) -> None:
    """List the installed plugins and the components that they provide."""
    plugins = load_plugins()
    if as_json:
        echo_json([asdict(status) for status in plugins.statuses])
        return
    echo_table(
        ("plugin", "distribution", "version", "state"),
        [(s.name, s.dist, s.version, s.state) for s in plugins.statuses],
    )
    for status in plugins.statuses:
        if status.error:
            click.echo(f"\n{status.name} of {status.dist} is {status.state}: {status.error}")
    for kind in KINDS:
        specs = list(plugins.registry.specs(kind))
        if specs and kind != "subcommand":
            click.echo(f"\n{kind}s")
            rows = [(s.name, plugins.registry.owner(kind, s.name) or "", s.summary) for s in specs]
            echo_table(("  name", "plugin", "summary"), [(f"  {n}", p, s) for n, p, s in rows])
