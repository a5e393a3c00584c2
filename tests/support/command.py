"""The command line in this process, by the entry point of the installed command ``posse``."""

from __future__ import annotations

import contextlib
import io
import warnings
from importlib.metadata import entry_points


def run_posse(*arguments: object) -> tuple[int, str, str]:
    """Exit code, output and errors of a command: ``run_posse("eval", folder, "--json")``."""
    (command,) = entry_points(group="console_scripts", name="posse")
    main, out, error = command.load(), io.StringIO(), io.StringIO()
    code: object = None
    # the command says warnings its own way from here on
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error), warnings.catch_warnings():
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as ended:
            code = ended.code
    assert isinstance(code, int)
    return code, out.getvalue(), error.getvalue()
