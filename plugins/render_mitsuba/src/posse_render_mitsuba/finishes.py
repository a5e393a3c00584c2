"""What varies of a material from frame to frame, as parameters of its Mitsuba BSDF. The variant must be
set before this module is imported."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from posse_core import Finish, Float32Array

PLAIN = Finish((1.0, 1.0, 1.0), 1.0)
"""The material as it is."""
LEAST_ALPHA = 1e-4
_POWERS = {"base_color": 1, "reflectance": 1, "roughness": 1, "alpha": 2}
"""Name of a BSDF's texture → by which power of its factor it is multiplied."""


class Finishing:
    """The textures of one BSDF that a :class:`posse_core.Finish` multiplies."""

    def __init__(self, bsdf: Any) -> None:
        self._parameters = mi.traverse(bsdf)
        self._last: Finish | None = None
        self._own: dict[str, tuple[str, Float32Array]] = {}
        for key, value in self._parameters:
            name = key.split(".")[-2] if "." in key else key
            if name in _POWERS and key.endswith((".data", ".value")):
                self._own[key] = name, np.asarray(value, dtype=np.float32).copy()

    def set(self, finish: Finish) -> bool:
        """Multiply the material's own values. They become opaque, so that kernels are compiled once.

        Returns:
            Whether the values are others than before.
        """
        if finish == self._last:
            return False
        self._last = finish
        for key, (name, own) in self._own.items():
            is_color = name in ("base_color", "reflectance")
            factor = finish.base_color if is_color else finish.roughness ** _POWERS[name]
            values = own * np.asarray(factor, dtype=np.float32)
            if name == "alpha":
                values = np.maximum(values, LEAST_ALPHA)
            made = mi.TensorXf(values) if key.endswith(".data") else mi.Float(float(values.ravel()[0]))
            dr.make_opaque(made)
            self._parameters[key] = made
        self._parameters.update()
        return True
