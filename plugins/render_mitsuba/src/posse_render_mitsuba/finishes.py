"""What varies of a material from frame to frame, as parameters of its Mitsuba BSDF, for the scalar
variant, which must be set before this module is imported."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np

from posse_core import Finish, Float32Array, Material
from posse_render_mitsuba.bsdfs import bsdf_of

PLAIN = Finish((1.0, 1.0, 1.0), 1.0)
"""The material as it is."""
LEAST_ALPHA = 1e-4
_POWERS = {"base_color": 1, "reflectance": 1, "roughness": 1, "alpha": 2}
"""Name of a BSDF's texture → by which power of its factor it is multiplied."""
_Values = dict[str, tuple[str, Float32Array]]
"""Key of a BSDF's parameter → the name of its texture, and its values."""


class Finishing:
    """The textures of one BSDF that a :class:`posse_core.Finish` multiplies or replaces."""

    def __init__(self, bsdf: Any, material: Material) -> None:
        """The BSDF is that of the material."""
        self._parameters = mi.traverse(bsdf)
        self._material = material
        self._last: Finish | None = None
        self._own: dict[int | None, _Values] = {None: _values(self._parameters)}

    def set(self, finish: Finish) -> None:
        """Multiply the material's own values, or those with a pattern."""
        if finish == self._last:
            return
        self._last = finish
        for key, (name, own) in self._with_pattern(finish.pattern).items():
            is_color = name in ("base_color", "reflectance")
            factor = finish.base_color if is_color else finish.roughness ** _POWERS[name]
            values = own * np.asarray(factor, dtype=np.float32)
            if name == "alpha":
                values = np.maximum(values, LEAST_ALPHA)
            made = mi.TensorXf(values) if key.endswith(".data") else mi.Float(float(values.ravel()[0]))
            self._parameters[key] = made
        self._parameters.update()

    def _with_pattern(self, pattern: int | None) -> _Values:
        if pattern not in self._own:
            material = replace(PLAIN, pattern=pattern).on(self._material)
            self._own[pattern] = _values(mi.traverse(bsdf_of(material)))
        return self._own[pattern]


def _values(parameters: Any) -> _Values:
    """Those of a BSDF's textures that vary."""
    values = {}
    for key, value in parameters:
        name = key.split(".")[-2] if "." in key else key
        if name in _POWERS and key.endswith((".data", ".value")):
            values[key] = name, np.asarray(value, dtype=np.float32).copy()
    return values
