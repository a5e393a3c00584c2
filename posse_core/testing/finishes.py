"""Conformance of renderers: materials that vary from frame to frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._model.finish import Finish
from posse_core._model.scene import FrameState, Radiance
from posse_core._model.spacecraft import Material
from posse_core.testing.stage import RendererStage, ball, facing

_CHEQUERS = np.kron(np.indices((8, 8)).sum(axis=0) % 2, np.ones((4, 4), dtype=int))
_COLOURS = np.array([(90, 120, 200), (230, 210, 160)], dtype=np.uint8)[_CHEQUERS]
_METALS = np.array([(0, 120), (255, 230)], dtype=np.uint8)[_CHEQUERS]
_MATERIALS = (
    Material("paint", (0.6, 0.5, 0.4), roughness=0.6),
    Material("metal", (0.8, 0.7, 0.5), metallic=1.0, roughness=0.5),
    Material(
        "tiles",
        (0.9, 0.9, 0.9),
        metallic=1.0,
        roughness=0.9,
        base_color_texture=_COLOURS,
        metallic_roughness_texture=_METALS,
    ),
)
_PATTERNED = Material(
    "patterned",
    (0.8, 0.8, 0.8),
    roughness=0.7,
    base_color_texture=_COLOURS,
    patterns=(_COLOURS, 255 - _COLOURS, np.full_like(_COLOURS, (40, 200, 90))),
)
_FINISHES = (Finish((0.5, 1.1, 0.8), 0.8), Finish((1.1, 0.7, 0.4), 1.1))
# Colours vary too, since a renderer may leave textures out.
_PATTERNS = (Finish((0.5, 0.8, 0.7), 1.0, 1), Finish((0.6, 1.1, 0.9), 0.9, 2))


class FinishesConformance(RendererStage):
    """A renderer draws each piece with the material that ``scene.materials(craft)`` gives."""

    def test_a_material_varies_from_frame_to_frame(self) -> None:
        """As if the scene had been opened with that material, and back again."""
        every = [(material, _FINISHES) for material in _MATERIALS]
        for material, finishes in (*every, (_PATTERNED, _PATTERNS)):
            frame = facing(sun=(0.5, 0.3, 1.0))
            with self.opened(ball(material)) as stage:
                plain = _light(stage.shot(frame))
                varied = [_light(stage.shot(_finished(frame, material, each))) for each in finishes]
                again = _light(stage.shot(frame))
            for made, finish in zip(varied, finishes, strict=True):
                with self.opened(ball(finish.on(material))) as stage:
                    expected = _light(stage.shot(frame))
                assert np.abs(made / plain - 1).max() > 0.1, "the material did not vary"
                what = f"{material.name} with {finish}"
                np.testing.assert_allclose(made, expected, rtol=0.02, err_msg=what)
            np.testing.assert_allclose(again, plain, rtol=0.02, err_msg=f"{material.name} as it was")


def _finished(frame: FrameState, material: Material, finish: Finish) -> FrameState:
    return replace(frame, craft=replace(frame.craft, finishes={material.name: finish}))


def _light(image: Radiance) -> FloatArray:
    """(3, 3) mean radiance per band in the upper, middle and lower third of the image."""
    thirds = np.array_split(image.radiance_rgb.astype(np.float64), 3)
    return np.array([third.mean(axis=(0, 1)) for third in thirds])
