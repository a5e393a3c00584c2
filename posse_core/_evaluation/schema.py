"""What a label line holds. An annotator that a scenario left out leaves its labels out."""

from __future__ import annotations

import json
from typing import Any

from posse_core._errors import InputError
from posse_core._model.label_line import LabelLine


def schema_fault(labels: dict[str, Any]) -> str | None:
    """The first thing that is wrong with a label line, or None."""
    try:
        LabelLine.from_json(json.dumps(labels).encode())
    except InputError as error:
        return str(error)
    return None
