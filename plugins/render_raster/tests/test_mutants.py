"""The conformance kit finds what is wrong with a renderer: the rasteriser with a changed shader."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import moderngl
import pytest

from posse_core.testing import RendererConformance
from posse_render_raster import craft
from posse_render_raster.options import RasterOptions
from posse_render_raster.renderer import RasterRenderer

LOBE = "test_the_lobe_of_coloured_metal"
SURFACE = "test_the_reflection_at_the_surface_of_paint"
PAINT = "test_coloured_paint"
BETWEEN = "test_what_is_between_metal_and_paint"
TEXTURES = "test_values_of_textures"
FURNACE = "test_the_furnace"
MIRRORED = "test_polished_metal_mirrors_the_sky"
BLURRED = "test_rough_metal_blurs_the_sky"

MUTANTS = {
    "lobe three times": (
        "fresnel * distribution",
        "3.0 * fresnel * distribution",
        {LOBE: "by this factor", SURFACE: "by this factor"},
    ),
    "lobe 0.3 times": (
        "fresnel * distribution",
        "0.3 * fresnel * distribution",
        {LOBE: "by this factor", SURFACE: "by this factor"},
    ),
    "lobe without shadowing": (
        "float shadowing = 0.5 /",
        "float shadowing = 0.25 / (n_l * n_v); float unused = 0.5 /",
        {LOBE: "closed form"},
    ),
    "alpha is the roughness": (
        "rough * rough * rough * rough + half_disc",
        "rough * rough + half_disc",
        {LOBE: "alpha is the roughness instead of its square"},
    ),
    "no Fresnel term": (
        "float edge = pow(1.0 - v_h, 5.0);",
        "float edge = 0.0;",
        {LOBE: "not everywhere"},
    ),
    "F0 of 0.4": (
        "vec3(0.04 * specular)",
        "vec3(0.4 * specular)",
        {SURFACE: "ten times 0.04"},
    ),
    "F0 of none": (
        "vec3(0.04 * specular)",
        "vec3(0.0)",
        {SURFACE: "a dielectric reflects nothing"},
    ),
    "specular ignored": (
        "vec3(0.04 * specular)",
        "vec3(0.04)",
        {SURFACE: "specular is ignored"},
    ),
    "base as bright as without a coat": ("diffuse * (1.0 - coat)", "diffuse", {PAINT: "closed form"}),
    "grey metal": (
        "vec3 f0 = mix(vec3(0.04 * specular), color, metal);",
        "vec3 f0 = mix(vec3(0.04 * specular), vec3(dot(color, vec3(1.0 / 3.0))), metal);",
        {LOBE: "metal reflects in grey", MIRRORED: "metal reflects the sky in grey"},
    ),
    "metal with a base": ("color * (1.0 - metal) / PI", "color / PI", {LOBE: "closed form"}),
    "metal or not": (
        "float metal = metallic * both.x",
        "float metal = ceil(metallic * both.x)",
        {BETWEEN: "every metal is a full one"},
    ),
    "coat of the mixture on the base": (
        "float coat = specular * (0.04 + 0.96 * edge);",
        "float coat = fresnel.r * (1.0 - metal);",
        {BETWEEN: "closed form"},
    ),
    "roughness texture ignored": (
        "rough = roughness * both.y",
        "rough = roughness",
        {TEXTURES: "the channel of roughness is ignored"},
    ),
    "metallic texture ignored": (
        "metal = metallic * both.x",
        "metal = metallic",
        {TEXTURES: "the channel of metallic is ignored"},
    ),
    "channels exchanged": (
        "texture_uv, FINER).rg",
        "texture_uv, FINER).gr",
        {TEXTURES: "metallic and roughness are exchanged"},
    ),
    "base colour texture ignored": (
        "base_color * texture(base_color_texture, texture_uv).rgb",
        "base_color * max(texture(base_color_texture, texture_uv).rgb, 1.0)",
        {TEXTURES: "the texture of the base colour is ignored"},
    ),
    "no sky on metal": (
        "lobe * fresnel + even",
        "lobe * fresnel * (1.0 - metal) + even",
        {
            FURNACE: "is the sky left out on metal",
            MIRRORED: "the sky is not reflected in metal",
            BLURRED: "the sky is not reflected in rough metal",
        },
    ),
    "bright lobe of the sky": (
        "lobe * fresnel + even",
        "1.1 * lobe * fresnel + even",
        {FURNACE: "it makes light"},
    ),
    "light between facets counted twice": (
        "lobe * fresnel + even",
        "lobe * fresnel / pow(albedo.x + albedo.y, 2.0) + even",
        {FURNACE: "it makes light"},
    ),
    "no sky on the base": ("* PI * diffuse * (1.0 - coat)", "* 0.0", {FURNACE: "white paint"}),
    "sky along the normal": (
        "map_uv(reflect(-v, n))",
        "map_uv(n)",
        {MIRRORED: "looked up along the normal"},
    ),
    "sky behind the metal": (
        "map_uv(reflect(-v, n))",
        "map_uv(-v)",
        {MIRRORED: "looked up behind the metal"},
    ),
    "sky of polished metal on rough metal": (
        "float layer = rough / PREFILTERED_STEP - 1.0;",
        "float layer = -1.0;",
        {BLURRED: "closed form"},
    ),
}
"""Name → what stands in craft.frag, what in its place, the tests that fail and what their errors say."""


class Kit(RendererConformance):
    capabilities = frozenset({"deterministic", "environment"})
    glossy_sky_tolerance = 0.1

    def renderer(self) -> RasterRenderer:
        return RasterRenderer(RasterOptions())


@pytest.fixture
def mutate(opengl: None, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Returns a function that replaces a piece of the shader of what renderers draw from then on."""

    shaders = Path(craft.__file__).parent / "shaders"

    def mutate(old: str, new: str) -> None:
        def program(context: moderngl.Context, vertex: str, fragment: str) -> moderngl.Program:
            text = (shaders / f"{fragment}.frag").read_text()
            if fragment == "craft":
                assert old in text
                text = text.replace(old, new)
            return context.program(
                vertex_shader=(shaders / f"{vertex}.vert").read_text(), fragment_shader=text
            )

        monkeypatch.setattr(craft, "program", program)

    return mutate


@pytest.mark.parametrize("name", MUTANTS)
def test_a_wrong_renderer_fails_for_its_own_reason(
    mutate: Callable[[str, str], None], name: str
) -> None:
    old, new, caught = MUTANTS[name]
    mutate(old, new)
    for test, reason in caught.items():
        with pytest.raises(AssertionError, match=reason):
            getattr(Kit(), test)()
