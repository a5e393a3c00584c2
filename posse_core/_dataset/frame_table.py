"""The labels of a dataset as a table of pandas."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from posse_core._errors import ComponentError
from posse_core._model.label_line import BodyLabels, LabelLine

if TYPE_CHECKING:
    import pandas as pd

_AXES = {3: ("x", "y", "z"), 4: ("w", "x", "y", "z")}
_UNITS = ("_m_s", "_rad_s", "_m", "_px")


def frame_table(lines: Iterable[LabelLine]) -> pd.DataFrame:
    """Return a table with one row per frame; labels that a frame lacks or that are null are missing.

    A vector has a column per component, named before the unit (``t_body_cam_x_m``). Names of keypoints,
    parts, joints and annotators become part of the column's name (``keypoint_K1_u_px``,
    ``part_tank_area_px``, ``joint_wing_value``, ``nearest.nearest_m``), and columns of a body beside the
    target begin with its name (``body_companion_range_m``). The run-lengths of masks are left out.

    Raises:
        ComponentError: pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError:
        raise ComponentError("a table of the frames needs pandas: pip install pandas") from None
    return pd.DataFrame([_row(line) for line in lines])


def _row(line: BodyLabels) -> dict[str, Any]:
    row: dict[str, Any] = {}
    for name, value in line:
        if name == "keypoints":
            for keypoint, (u_px, v_px, visibility) in value.items():
                row[f"keypoint_{keypoint}_u_px"] = u_px
                row[f"keypoint_{keypoint}_v_px"] = v_px
                row[f"keypoint_{keypoint}_visibility"] = visibility
        elif name == "part_area_px":
            row |= {f"part_{part}_area_px": area for part, area in value.items()}
        elif name == "joints":
            for joint, labels in value.items():
                row[f"joint_{joint}_value"], row[f"joint_{joint}_rate"] = labels.value, labels.rate
                row |= _columns(f"joint_{joint}_q_cam_from_link", labels.q_cam_from_link)
                row |= _columns(f"joint_{joint}_t_link_cam_m", labels.t_link_cam_m)
        elif name == "bodies":
            for body, labels in value.items():
                row |= {f"body_{body}_{column}": x for column, x in _row(labels).items()}
        elif name in ("box_visible_px", "box_whole_px"):
            for i, side in enumerate(("x", "y", "width", "height")):
                row[_with(name, side)] = None if value is None else value[i]
        elif name == "origin":
            row["origin_dataset"], row["origin_index"] = value
        elif isinstance(value, tuple):
            row |= _columns(name, value)
        elif name in line.extras:
            row |= {f"{name}.{key}": x for key, x in value.items()}
        elif name != "mask_rle":
            row[name] = value
    return row


def _columns(name: str, vector: tuple[float, ...]) -> dict[str, float]:
    return {_with(name, axis): x for axis, x in zip(_AXES[len(vector)], vector, strict=True)}


def _with(name: str, component: str) -> str:
    """Return the column of a vector's component: the component goes before the unit, if there is one."""
    unit = next((unit for unit in _UNITS if name.endswith(unit)), "")
    return f"{name.removesuffix(unit)}_{component}{unit}"
