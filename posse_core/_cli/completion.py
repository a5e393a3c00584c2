"""``posse completion``: prints the script by which a shell completes POSSE's commands.

Click works out what may follow. The scripts for bash and zsh are our own: after Click's, a space
stands behind ``renderer.``, and bash takes ``renderer.name=mitsuba`` for three words.
"""

from __future__ import annotations

import os
from typing import ClassVar, Final

import click
from click.shell_completion import (
    BashComplete,
    FishComplete,
    ShellComplete,
    ZshComplete,
    add_completion_class,
    split_arg_string,
)

from posse_core._cli.common import COMPLETING
from posse_core._cli.progress import phase
from posse_core._plugins.loading import load_plugins

_BASH = """\
%(complete_func)s() {
    local response line type value typed word split
    local IFS=$'\\n'
    word=${COMP_WORDS[COMP_CWORD]}
    [[ $word == [=:] ]] && word=
    typed=${COMP_LINE:0:COMP_POINT}
    response=$(env COMP_LINE="$typed" %(complete_var)s=bash_complete "$1" 2>/dev/null)
    typed=${typed##*[[:space:]]}
    split=${typed%%"$word"}
    for line in $response; do
        IFS=',' read -r type value <<< "$line"
        if [[ $type == dir ]]; then
            compopt -o filenames
            COMPREPLY+=($(compgen -d -- "$word"))
        elif [[ $type == file ]]; then
            compopt -o filenames
            COMPREPLY+=($(compgen -f -- "$word"))
        else
            [[ $value == *[.=] ]] && compopt -o nospace
            COMPREPLY+=("${value#"$split"}")
        fi
    done
}

complete -o nosort -F %(complete_func)s %(prog_name)s
"""

_ZSH = """\
#compdef %(prog_name)s

%(complete_func)s() {
    local -a words_found ends_open response
    local type key about
    (( ! $+commands[%(prog_name)s] )) && return 1
    response=("${(@f)$(env COMP_WORDS="${words[*]}" COMP_CWORD=$((CURRENT-1)) \
%(complete_var)s=zsh_complete %(prog_name)s 2>/dev/null)}")
    for type key about in ${response}; do
        if [[ $type == dir ]]; then
            _path_files -/
        elif [[ $type == file ]]; then
            _path_files -f
        else
            [[ $about == _ ]] && about=
            if [[ $key == *[.=] ]]; then
                ends_open+=("$key${about:+:$about}")
            else
                words_found+=("$key${about:+:$about}")
            fi
        fi
    done
    (( $#words_found )) && _describe -V words words_found -U
    (( $#ends_open )) && _describe -V keys ends_open -U -S ''
}

if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
    %(complete_func)s "$@"
else
    compdef %(complete_func)s %(prog_name)s
fi
"""


class _Bash(BashComplete):
    """Completion from the whole line, in which keys and values are one word."""

    source_template: ClassVar[str] = _BASH

    def get_completion_args(self) -> tuple[list[str], str]:
        line = os.environ["COMP_LINE"]
        words = split_arg_string(line)[1:]
        return (words, "") if line[-1:].isspace() else (words[:-1], words[-1] if words else "")


class _Zsh(ZshComplete):
    source_template: ClassVar[str] = _ZSH


SHELLS: Final[dict[str, type[ShellComplete]]] = {"bash": _Bash, "zsh": _Zsh, "fish": FishComplete}


def know_shells() -> None:
    """Let Click answer the shells' scripts."""
    for shell in SHELLS.values():
        add_completion_class(shell)


@click.command()
@click.argument("shell", type=click.Choice(list(SHELLS)))
@click.pass_context
def command(ctx: click.Context, shell: str) -> None:
    """Print the script by which SHELL completes commands, options, names, keys and values.

    \b
    bash  posse completion bash > ~/.local/share/bash-completion/completions/posse
    zsh   posse completion zsh > FOLDER/_posse, where FOLDER is in fpath
    fish  posse completion fish > ~/.config/fish/completions/posse.fish

    It takes effect in the next shell. 'eval "$(posse completion bash)"', or zsh, is for this one.
    """
    from posse_core._cli.keys import key_table

    with phase("looking up keys"):
        key_table(load_plugins())  # kept in the cache, so that the first press is quick too
    # not by source(), which runs bash to warn of versions before 4.4
    made = SHELLS[shell](ctx.find_root().command, {}, "posse", COMPLETING)
    click.echo(made.source_template % made.source_vars(), nl=False)
