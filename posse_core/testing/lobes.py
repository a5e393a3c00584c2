"""Conformance of renderers: the lobes of metal and paint under the Sun and the sky."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from posse_core._arrays import AnyArray, Float32Array, FloatArray
from posse_core._model.camera import PixelBox
from posse_core._model.scene import EnvironmentMap, FrameState
from posse_core._model.spacecraft import Material
from posse_core._model.srgb import linear_from_srgb
from posse_core.testing import scenes
from posse_core.testing.closed_forms import (
    directions,
    fine_rays,
    pixel_means,
    plate_under_a_sky,
    plate_under_the_sun,
)
from posse_core.testing.stage import RendererStage, facing, wall

_GOLD = Material("gold", (0.9, 0.6, 0.2), metallic=1.0, roughness=0.35)
_LACQUER = Material("lacquer", (0.0, 0.0, 0.0), roughness=0.5)
"""Black, so that it shows the reflection at its surface alone."""
_PAINT = Material("paint", (0.8, 0.5, 0.2), roughness=0.5)
_SILVER = Material("silver", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.1)
_SUN_ABOUT = ((0.0, 0.0, 1.0), (0.3, 0.2, 1.0))
"""Directions of the Sun near the camera, where Schlick's Fresnel term is within 1 % of the
dielectric's that it approximates."""
_SUN_ASIDE = ((-0.8, 0.5, 1.0), (1.5, 0.0, 1.0))
_BLOCK_PX = 8
_DIMMEST = 0.01
"""Share of the brightest block below which blocks are not compared."""

_FACTORS = Material("print", (0.9, 0.8, 0.7), metallic=0.9, roughness=0.8)
_PATCHES = {
    "top left": ((230, 150, 90), (255, 110)),
    "top right": ((150, 190, 230), (90, 150)),
    "bottom left": ((200, 90, 160), (0, 200)),
    "bottom right": ((100, 170, 120), (170, 90)),
}
"""Codes of the base colour, and those of metallic and roughness, in the quarters of the texture."""
_INSIDE = {
    "top left": np.s_[:8, :11],
    "top right": np.s_[:8, 21:],
    "bottom left": np.s_[16:, :11],
    "bottom right": np.s_[16:, 21:],
}
"""Pixels of the wall's image in which a quarter is seen, away from its edges."""


class LobesConformance(RendererStage):
    """glTF's metallic-roughness model (2.0, appendix B) under the Sun, and under the sky with the
    capability ``environment``."""

    def test_the_lobe_of_coloured_metal(self) -> None:
        """Shape, size and colour of the GGX lobe, integrated over pixels and the Sun's disc."""
        for roughness in (0.2, 0.35, 0.7):
            # Models differ in how rough facets shade each other where light and view graze.
            grazing = [_grazing()] if roughness < 0.5 else []
            gold = replace(_GOLD, roughness=roughness)
            self._assert_lobe(gold, [*map(facing, (*_SUN_ABOUT, *_SUN_ASIDE)), *grazing])

    def test_the_reflection_at_the_surface_of_paint(self) -> None:
        """The lobe of a dielectric with F0 = 4 %, and in proportion to ``specular``."""
        for material in (_LACQUER, replace(_LACQUER, roughness=0.3), replace(_LACQUER, specular=0.5)):
            self._assert_lobe(material, map(facing, _SUN_ABOUT))

    def test_coloured_paint(self) -> None:
        """A Lambertian base, less what the surface above it reflects, and the surface's own lobe."""
        for material in (_PAINT, replace(_PAINT, roughness=1.0)):
            self._assert_lobe(material, map(facing, (*_SUN_ABOUT, *_SUN_ASIDE)))

    def test_what_is_between_metal_and_paint(self) -> None:
        """``metallic`` mixes the light of a metal and that of a dielectric."""
        half = replace(_PAINT, metallic=0.5)
        self._assert_lobe(half, map(facing, (*_SUN_ABOUT, *_SUN_ASIDE)))

    def test_values_of_textures(self) -> None:
        """Base colour, metallic and roughness by textures with other values than 0 and 255, each times
        its factor."""
        base, both = (_quarters([codes[i] for codes in _PATCHES.values()]) for i in (0, 1))
        printed = replace(_FACTORS, base_color_texture=base, metallic_roughness_texture=both)
        with self.opened(wall(printed)) as stage:
            for sun in _SUN_ABOUT:
                frame = facing(sun)
                image = stage.shot(frame).radiance_rgb
                for name, (color, channels) in _PATCHES.items():
                    right, mistakes = _printed(color, channels)

                    def light(
                        material: Material, frame: FrameState = frame, inside: Any = _INSIDE[name]
                    ) -> FloatArray:
                        wall_light = plate_under_the_sun(stage.camera, frame, material)
                        return np.asarray(wall_light[inside].mean(axis=(0, 1)))

                    _assert_light(
                        image[_INSIDE[name]].mean(axis=(0, 1)),
                        light(right),
                        self.lobe_tolerance,
                        f"{name} quarter of a texture, the Sun in {sun}",
                        {text: partial(light, wrong) for text, wrong in mistakes.items()},
                    )

    def test_the_furnace(self) -> None:
        """Capability ``environment``: in an even surround a metal of reflectance 1 gives no more light
        than comes in, and no less than what its facets reflect once; a polished one, and white
        paint, give the surround's own."""
        if "environment" not in self.capabilities:
            return
        surround = EnvironmentMap(np.ones((16, 32, 3), dtype=np.float32))
        slack = self.lobe_tolerance
        for material in (_SILVER, replace(_SILVER, roughness=0.4), replace(_SILVER, roughness=0.7)):
            for tilt, once, light in self._under(surround, material):
                least = 1.0 if material is _SILVER else once.min()
                what = (
                    f"a metal of reflectance 1 and roughness {material.roughness}, tilted by {tilt} rad "
                    "from the camera, in a surround of 1 W/m²/sr"
                )
                assert light.max() <= 1 + slack, (
                    f"{what}, sends out {light.max():.3f}: it makes light; is the lobe of the sky "
                    "divided by its weights' sum, and the light between facets not counted twice?"
                )
                assert light.min() >= least * (1 - slack), (
                    f"{what}, sends out {light.min():.3f}, less than the {least:.3f} that its facets "
                    "reflect once: is the sky left out on metal, or the lobe of the sky too weak?"
                )
        white = replace(_PAINT, base_color=(1.0, 1.0, 1.0))
        for tilt, once, light in self._under(surround, white):
            what = f"white paint, tilted by {tilt} rad, in an even surround"
            _assert_light(light, once, self.lobe_tolerance, what)

    def test_polished_metal_mirrors_the_sky(self) -> None:
        """Capability ``environment``: in each pixel, the sky in the mirrored direction times the metal's
        colour."""
        if "environment" not in self.capabilities:
            return
        polished = replace(_GOLD, roughness=0.1)
        with self.opened(wall(polished)) as stage:
            rays = fine_rays(stage.camera, 1)
            for tilt in (0.0, 0.35, -0.35):
                frame = _tilted(tilt)
                normal = frame.craft.R_cam_from_body[:, 2]
                sky = EnvironmentMap(_sky(directions(64)))
                light = stage.shot(frame, environment=sky).radiance_rgb
                mirrored = rays - 2 * (rays @ normal)[..., None] * normal
                looked_up = {
                    "the sky is looked up along the normal": np.broadcast_to(normal, rays.shape),
                    "the sky is looked up behind the metal": rays,
                    "the sky is looked up in body axes": mirrored @ frame.craft.R_cam_from_body,
                }
                gold = np.array(_GOLD.base_color)
                _assert_light(
                    _blocks(light),
                    _reflected(mirrored, gold),
                    self.lobe_tolerance,
                    f"polished metal, tilted by {tilt} rad, under a sky that brightens to one side",
                    {
                        "the sky is not reflected in metal": lambda: _blocks(np.zeros((24, 32, 3))),
                        "metal reflects the sky in grey": partial(_reflected, mirrored, gold.mean()),
                        **{text: partial(_reflected, d, gold) for text, d in looked_up.items()},
                    },
                )

    def test_rough_metal_blurs_the_sky(self) -> None:
        """Capability ``environment``: the sky, averaged over the lobe."""
        if "environment" not in self.capabilities:
            return
        rough = replace(_GOLD, roughness=0.5)
        for tilt, once, light in self._under(EnvironmentMap(_sky(directions(32))), rough):
            what = (
                f"metal of roughness 0.5, tilted by {tilt} rad, under a sky that brightens to one side"
            )
            mistakes = {"the sky is not reflected in rough metal": partial(np.zeros, 3)}
            _assert_light(light, once, self.glossy_sky_tolerance, what, mistakes)

    def _assert_lobe(self, material: Material, frames: Iterable[FrameState]) -> None:
        """Compare the light of a wall of a material with the closed form."""
        with self.opened(wall(material)) as stage:
            for frame in frames:

                def light(material: Material, frame: FrameState = frame) -> FloatArray:
                    return _blocks(plate_under_the_sun(stage.camera, frame, material))

                _assert_light(
                    _blocks(stage.shot(frame).radiance_rgb),
                    light(material),
                    self.lobe_tolerance,
                    f"{_described(material)}, {_seen(frame)}",
                    {text: partial(light, wrong) for text, wrong in _mistakes(material).items()},
                )

    def _under(
        self, sky: EnvironmentMap, material: Material
    ) -> Iterator[tuple[float, FloatArray, FloatArray]]:
        """For three tilts of a wall without sunlight: the tilt, the light (3,) that its facets and
        base reflect once, and that in the middle of the image."""
        with self.opened(wall(material)) as stage:
            middle = PixelBox(stage.camera.width_px // 2 - 4, stage.camera.height_px // 2 - 4, 8, 8)
            for tilt in (0.0, 0.6, 1.0):
                frame = _tilted(tilt)
                image = stage.shot(frame, box=middle, environment=sky)
                once = plate_under_a_sky(frame, material, sky)
                yield tilt, once, image.radiance_rgb.mean(axis=(0, 1), dtype=np.float64)


def _grazing() -> FrameState:
    """A wall that is seen and lit at grazing angles, from opposite sides."""
    turned = _tilted(1.0)
    to_camera = turned.craft.R_cam_from_body.T @ [0.0, 0.0, -1.0]
    return scenes.frame(
        t_body_cam_m=(0.0, 0.0, 4.0),
        sun_direction_body=_triple(to_camera * [-1.0, -1.0, 1.0]),
        R_cam_from_body=turned.craft.R_cam_from_body,
    )


def _seen(frame: FrameState) -> str:
    """Where camera and Sun are, in words."""
    normal = frame.craft.R_cam_from_body[:, 2]
    camera, sun = np.degrees(np.arccos([-normal[2], normal @ frame.craft.sun_direction_cam]))
    between = np.degrees(np.arccos(-frame.craft.sun_direction_cam[2]))
    return f"camera {camera:.0f}° and Sun {sun:.0f}° from the normal, {between:.0f}° from each other"


def _described(material: Material) -> str:
    """A material in words."""
    kind = {0.0: "paint", 1.0: "metal"}.get(material.metallic, f"{material.metallic:g} metallic")
    r, g, b = material.base_color
    of = "" if material.metallic == 1 else f", specular {material.specular:g}"
    return f"{kind} of colour ({r:g}, {g:g}, {b:g}) and roughness {material.roughness:g}{of}"


def _mistakes(material: Material) -> Mapping[str, Material]:
    """Mistakes that are often made → a material that looks right as this one looks with them."""
    grey = float(np.mean(material.base_color))
    found = {
        "alpha is the roughness instead of its square": replace(
            material, roughness=material.roughness**0.5
        ),
        "the roughness is ignored": replace(material, roughness=1.0),
        "a dielectric reflects nothing at its surface": replace(material, specular=0.0),
        "specular is ignored": replace(material, specular=1.0),
        "F0 of a dielectric is ten times 0.04": replace(material, specular=10.0),
    }
    if material.metallic > 0:
        found |= {
            "metal reflects in grey": replace(material, base_color=(grey, grey, grey)),
            "metallic is ignored": replace(material, metallic=0.0),
            "every metal is a full one": replace(material, metallic=1.0),
        }
    return {text: wrong for text, wrong in found.items() if wrong != material}


def _printed(
    color: tuple[int, ...], channels: tuple[int, int]
) -> tuple[Material, Mapping[str, Material]]:
    """The material under texels with these codes, and what it looks like by mistakes."""
    code, (metallic, roughness) = np.array(color) / 255, np.array(channels) / 255
    linear = linear_from_srgb(code)
    right = _under_texels(linear, metallic, roughness)
    mistakes = {
        "the texture of the base colour is ignored": replace(right, base_color=_FACTORS.base_color),
        "the sRGB codes of the base colour are not decoded": _under_texels(code, metallic, roughness),
        "the channel of metallic is ignored": replace(right, metallic=_FACTORS.metallic),
        "the channel of roughness is ignored": replace(right, roughness=_FACTORS.roughness),
        "metallic and roughness are exchanged": _under_texels(linear, roughness, metallic),
        "metallic and roughness are decoded from sRGB": _under_texels(
            linear, *linear_from_srgb(np.array([metallic, roughness]))
        ),
        "the texels replace the factors": replace(
            right, base_color=_triple(linear), metallic=metallic, roughness=roughness
        ),
    }
    return right, mistakes


def _assert_light(
    measured: FloatArray,
    expected: FloatArray,
    tolerance: float,
    what: str,
    mistakes: Mapping[str, Callable[[], FloatArray]] = MappingProxyType({}),
) -> None:
    """Compare radiances (..., 3). The error says in words how they differ, and which of the ``mistakes``
    gives what was measured."""
    floor = np.maximum(expected, _DIMMEST * expected.max())

    def error(other: FloatArray) -> float:
        return float((np.abs(measured - other) / floor).max())

    off = error(expected)
    if off <= tolerance:
        return
    ratio = measured.sum() / expected.sum()
    bands = measured.reshape(-1, 3).sum(axis=0) / expected.reshape(-1, 3).sum(axis=0).clip(1e-12)
    alike = {text: error(light()) for text, light in mistakes.items()}
    guess = min(alike, key=lambda text: alike[text], default="")
    if guess and alike[guess] < min(0.3 * off, 0.1):
        cause = f"it is what comes out if {guess}"
    elif error(ratio * expected) <= max(tolerance, 0.1 * off):
        cause = "everywhere by this factor: is one missing in the lobe or the light, or there twice?"
    else:
        cause = "not everywhere alike: are the width of the lobe, the Fresnel term, the colour right?"
    raise AssertionError(
        f"{what}: {ratio:.3f} times the light of the closed form "
        f"(red, green, blue: {bands.round(3).tolist()}), at worst off by {off:.1%} where "
        f"{tolerance:.1%} is allowed; {cause}"
    )


def _reflected(directions_cam: FloatArray, color: FloatArray) -> FloatArray:
    """The sky in these directions (H, W, 3) as a metal reflects it, in blocks."""
    return _blocks(_sky(directions_cam) * color)


def _blocks(image: AnyArray) -> FloatArray:
    """(H, W, 3) → (H/8, W/8, 3), means over squares of pixels."""
    return pixel_means(np.asarray(image, dtype=np.float64), _BLOCK_PX)


def _quarters(codes: list[tuple[int, ...]]) -> AnyArray:
    """A texture (256, 256, c) uint8 with one code in each quarter, by rows."""
    two_by_two = np.array(codes, dtype=np.uint8).reshape(2, 2, -1)
    return np.kron(two_by_two, np.ones((128, 128, 1), dtype=np.uint8))


def _under_texels(base_color: FloatArray, metallic: float, roughness: float) -> Material:
    """The factors times these linear values."""
    return replace(
        _FACTORS,
        base_color=_triple(base_color * _FACTORS.base_color),
        metallic=_FACTORS.metallic * metallic,
        roughness=_FACTORS.roughness * roughness,
    )


def _triple(values: FloatArray) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def _tilted(tilt: float) -> FrameState:
    """A wall 4 m in front of the camera without sunlight, turned by ``tilt`` about the image's
    vertical."""
    return scenes.frame(
        t_body_cam_m=(0.0, 0.0, 4.0),
        sun_direction_body=(0.0, 0.0, 1.0),
        R_cam_from_body=Rotation.from_euler("y", tilt).as_matrix() @ scenes.FACING,
        sun_fraction=0.0,
    )


def _sky(directions_cam: FloatArray) -> Float32Array:
    """(..., 3) radiance of a sky that brightens evenly from one side to the other."""
    share = 1 + 0.8 * directions_cam @ [0.6, -0.64, -0.48]
    return np.asarray(share[..., None] * [1.0, 0.8, 0.6], dtype=np.float32)
