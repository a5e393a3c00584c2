"""``posse manoeuvres``: lists the impulses of a scenario's plan and their total."""

from __future__ import annotations

import click

from posse_core._cli import completing
from posse_core._cli.common import echo_json, echo_table, naming, read_scenario, scenario_options
from posse_core._cli.progress import phase
from posse_core._errors import InputError


@click.command()
@click.argument("scenario", shell_complete=completing.scenarios)
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@scenario_options
def command(
    scenario: str, as_json: bool, seed: int | None, frames: int | None, overrides: tuple[str, ...]
) -> None:
    """List the impulses of SCENARIO's relative.plan and their sum; for a transfer, the least sum too."""
    from posse_core._trajectory.problem import planned, starts_of, target_at_epoch

    checked = read_scenario(scenario, overrides, seed=seed, frames=frames)
    if checked.relative.plan is None:
        raise InputError(f"{scenario}: there is no relative.plan; add one with burns or a transfer")
    with naming(scenario), phase("computing the impulses"):
        target = target_at_epoch(checked.orbit, checked.constants)
        plan = planned(checked.relative.plan, starts_of(target, checked.relative)[0])
    if as_json:
        burns = [{"t_s": b.t_s, "dv_rtn_m_s": b.dv_rtn_m_s.tolist()} for b in plan.burns]
        echo_json({"burns": burns, "dv_m_s": plan.dv_m_s, "least_dv_m_s": plan.least_dv_m_s})
        return
    echo_table(
        ("t_s", "radial", "along", "cross  m/s"),
        [(f"{b.t_s:.3f}", *(f"{x:+.6f}" for x in b.dv_rtn_m_s)) for b in plan.burns],
    )
    click.echo(f"total {plan.dv_m_s:.6f} m/s")
    if plan.least_dv_m_s:
        click.echo(f"least possible in this window {plan.least_dv_m_s:.6f} m/s, to first order")
