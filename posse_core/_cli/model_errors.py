"""``posse model-errors``: measures the error of each model of relative motion."""

from __future__ import annotations

import click

from posse_core._cli.common import echo_json, echo_table
from posse_core._cli.progress import bar


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def command(as_json: bool) -> None:
    """Print the largest position error of each model of relative motion, metres.

    The reference is numerically integrated motion: of Aqua over one and ten orbits, of Cluster
    (e = 0.52) over one, with separations of 100 m and more. A column is a case: the target, the gravity
    (two-body, or with the Earth's flattening, J2) and the number of orbits.
    """
    import numpy as np

    from posse_core._constants import Constants
    from posse_core._evaluation.model_errors import cases, errors
    from posse_core._evaluation.numbers import number

    constants = Constants()
    columns: dict[str, dict[str, float]] = {}
    known = cases(constants)
    for case in bar(known, len(known), "integrating", unit="case"):
        result = errors(case, constants)
        for orbits in sorted({1, case.orbits}):
            flown = result.orbits <= orbits
            plural = "s" if orbits > 1 else ""
            columns[f"{case.name}, {case.gravity}, {orbits} orbit{plural}"] = {
                model: float(np.max(history[flown])) for model, history in result.by_model.items()
            }
    if as_json:
        echo_json(columns)
        return
    models = list(next(iter(columns.values())))
    echo_table(
        ("worst error, m", *columns),
        [(model, *(number(column[model], 2) for column in columns.values())) for model in models],
    )
