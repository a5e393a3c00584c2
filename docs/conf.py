"""How Sphinx makes the site of this folder: ``make docs``."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

# Only now: reference.py is found on the path that was set above.
import reference  # noqa: E402

import posse_core  # noqa: E402

project = "POSSE"
author = "the authors of POSSE"
version = release = posse_core.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"POSSE {release}"
html_copy_source = False
html_show_sphinx = False

# The anchors of headings are those that code hosts make, down to the deepest heading of the pages.
myst_heading_anchors = 4

# Types stand in the signatures; attributes are told by the docstrings' "Attributes:".
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    name: f"posse_core.{name}" for name in reference.public_names()["Types of arrays"]
}
maximum_signature_line_length = 90
napoleon_use_ivar = True
python_use_unqualified_type_names = True

# Nothing is fetched while building, so names of other projects stay without links, as do private classes
# and what the conformance kit is built of.
nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(?!posse_core\.[A-Za-z]).*|posse_core\.testing\.\w+\..*")]


def _link_pages_from_elsewhere(app: Sphinx, page: str, source: list[str]) -> None:
    path = Path(app.env.doc2path(page)).resolve()
    source[0] = reference.relinked(source[0], path.parent, path.parent)


def _resolve_public_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, shown: nodes.Element
) -> nodes.Element | None:
    """Link a class that annotations know by its private module to its public name."""
    public = f"posse_core.{node['reftarget'].rpartition('.')[2]}"
    domain = env.domains.python_domain
    if node["refdomain"] != "py" or public not in domain.objects:
        return None
    return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", public, node, shown)


# What Sphinx cannot show as it was written: a constraint of pydantic beside the type, an alias
# of a type within another type, and defaults whose text is no Python.
_CONSTRAINED = re.compile(
    r"~?(?:typing\.)?Annotated\[((?:[^\[\],]|\[[^\[\]]*\])+)(?:, [~\w.]+\((?:[^()]|\([^()]*\))*\))+\]"
)
_ALIAS = re.compile(r"~?(?:[\w.]+\.)?TypeAliasForwardRef\('([\w.]+)'\)")
_NO_PYTHON = re.compile(r"= (?:<[^>]*>|not made)")


def _readable_signature(
    app: Sphinx,
    what: str,
    name: str,
    found: object,
    options: object,
    parameters: str | None,
    result: str | None,
) -> tuple[str | None, str | None]:
    def readable(text: str | None) -> str | None:
        if text is None:
            return None
        return _NO_PYTHON.sub("= ...", _ALIAS.sub(r"\1", _CONSTRAINED.sub(r"\1", text)))

    return readable(parameters), readable(result)


# Napoleon takes what is before a colon in the first line of a property for its type; ours are sentences.
# So the colon is another character while Napoleon reads.
_HIDDEN_COLON = "\ue000"


def _hide_colon(
    app: Sphinx, what: str, name: str, found: object, options: object, lines: list[str]
) -> None:
    if what in ("property", "attribute") and lines:
        lines[0] = lines[0].replace(":", _HIDDEN_COLON)


def _show_colon(
    app: Sphinx, what: str, name: str, found: object, options: object, lines: list[str]
) -> None:
    lines[:] = [line.replace(_HIDDEN_COLON, ":") for line in lines]


def setup(app: Sphinx) -> None:
    app.connect("builder-inited", lambda app: reference.write())
    app.connect("source-read", _link_pages_from_elsewhere)
    app.connect("autodoc-process-signature", _readable_signature)
    app.connect("autodoc-process-docstring", _hide_colon, priority=400)
    app.connect("autodoc-process-docstring", _show_colon, priority=600)
    app.connect("missing-reference", _resolve_public_name)
