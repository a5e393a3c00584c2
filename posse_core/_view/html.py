"""The HTML of every page here: one file, its data in script elements of JSON, its scripts at the end."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any


def page_halves(
    body: str, styles: Sequence[str], scripts: Sequence[str], blocks: Mapping[str, Any]
) -> tuple[bytes, bytes]:
    """A page in two halves, between which more blocks may stand.

    Args:
        body: HTML.
        styles, scripts: files of this package; the skeleton is its ``page.html``.
        blocks: JSON values for the scripts, by the id of their element.
    """
    page = read("page.html").replace("/*STYLE*/", "".join(map(read, styles)))
    before, after = page.replace("<!--BODY-->\n", body).split("<!--FRAMES-->\n")
    head = before.encode() + b"".join(script_block(name, value) for name, value in blocks.items())
    return head, after.replace("/*SCRIPT*/", "\n".join(map(read, scripts))).encode()


def script_block(name: str, value: Any) -> bytes:
    """JSON that the page's script reads; nothing in it can end the element or begin another."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    text = text.replace("</", "\\u003c/").replace("<!", "\\u003c!")
    return f'<script type="application/json" id="{name}">{text}</script>\n'.encode()


def read(name: str) -> str:
    """A file of this package."""
    return files("posse_core._view").joinpath(name).read_text(encoding="utf-8")
