"""The renderer ``raster``. Each frame it draws a shadow map of every body, then the image tile by tile:
several samples per pixel, which are averaged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata

import moderngl
import numpy as np

from posse_core import (
    ComponentError,
    EnvironmentMap,
    Float32Array,
    LinkPoses,
    Material,
    PixelBox,
    Radiance,
    Renderer,
    RenderRequest,
    Scene,
)
from posse_render_raster.context import create_context
from posse_render_raster.craft import FREE_UNIT, Craft, program, set_matrix
from posse_render_raster.options import RasterOptions
from posse_render_raster.placing import Layer, Shade, layers, shades
from posse_render_raster.sky_light import convolved, lobe_albedo

Map = moderngl.Texture | moderngl.TextureArray

TILE_SAMPLES = 1536
"""Width and height of the sample buffer, in samples. It takes 47 MB, whatever the size of the image."""
FULL_SHADOW_MAPS = 4
"""How many bodies have a shadow map of the option's size; those of more bodies are smaller, so that all
together they have as many texels."""
LEAST_SHADOW_MAP = 128
"""Texels across the shadow map of a body that is only a few samples wide. Of so many, the map's empty
margin is wider than half a texel, so that none from beyond the map is filtered in."""
GL_DEPTH_CLAMP = 0x864F
"""What is nearer than the near plane is drawn at its depth instead of being cut off."""


@dataclass(frozen=True)
class _ShadowMap:
    """The shadow map of one body."""

    target: moderngl.Framebuffer
    depth: moderngl.Texture


@dataclass(frozen=True)
class _Drawing:
    """What all tiles of a frame share.

    Attributes:
        poses: of the links.
        shades: of the bodies.
        layers: the links, the farthest first.
        materials: of the scene's pieces.
    """

    poses: LinkPoses
    shades: Sequence[Shade]
    layers: Sequence[Layer]
    materials: Sequence[Material]


@dataclass(frozen=True)
class _Stage:
    """The OpenGL objects that exist from open to close."""

    context: moderngl.Context
    scene: Scene
    craft: Craft
    shadows: Sequence[_ShadowMap]
    depths: moderngl.Framebuffer
    samples: moderngl.Framebuffer
    sampled: moderngl.Texture
    pixels: moderngl.Framebuffer
    average: moderngl.VertexArray
    lobe_albedo: moderngl.Texture


class RasterRenderer(Renderer[RasterOptions]):
    """A rasteriser that uses OpenGL through EGL."""

    def __init__(self, options: RasterOptions) -> None:
        super().__init__(options)
        self._stage: _Stage | None = None
        self._lit_by: tuple[EnvironmentMap, list[Map]] | None = None
        self._described: dict[str, str] = {}

    def open(self, scene: Scene) -> None:
        """Create an OpenGL context and load the scene into it.

        Raises:
            ComponentError: there is no EGL or no EGL driver (the message names the packages to install),
                or the driver fails, for example because the shadow map is too large.
        """
        self.close()
        context = create_context()
        self._described = {
            "opengl": context.info["GL_VERSION"],
            "device": context.info["GL_RENDERER"],
            "moderngl": metadata.version("moderngl"),
        }
        try:
            self._stage = _set_up(context, scene, self.options)
        except moderngl.Error as error:
            context.release()
            reason = " ".join(str(error).split())
            raise ComponentError(
                f"raster: {self._described['device']} failed: {reason}; "
                "try a smaller shadow_map_px, or choose another device with GLCONTEXT_DEVICE_INDEX"
            ) from None

    def render(self, request: RenderRequest) -> Radiance:
        """Render one frame's box."""
        stage = self._stage
        if stage is None:
            raise ComponentError("raster: the renderer is not open")
        box, n = request.box, self.options.samples_per_axis
        image = np.empty((box.height, box.width, 4), dtype=np.float32)
        z_m = np.empty((box.height, box.width), dtype=np.float32)
        with stage.context:
            drawing = self._set_frame(stage, request)
            for x0, y0, part in _tiles(box, TILE_SAMPLES // n):
                rows, columns = PixelBox(
                    part.x0 - box.x0, part.y0 - box.y0, part.width, part.height
                ).slices
                image[rows, columns], z_m[rows, columns] = self._draw_tile(stage, drawing, x0, y0, part)
        return Radiance(
            box=box,
            radiance_rgb=np.ascontiguousarray(image[..., :3]),
            coverage=np.ascontiguousarray(image[..., 3]),
            depth_m=np.where(z_m > 0, z_m, np.float32(np.nan)),
        )

    def close(self) -> None:
        """Release the OpenGL context."""
        if self._stage is not None:
            self._stage.context.release()
            self._stage = self._lit_by = None

    def describe(self) -> Mapping[str, str]:
        """The versions of OpenGL and moderngl, and the device that renders."""
        return self._described

    @classmethod
    def doctor(cls, options: RasterOptions) -> Sequence[tuple[str, bool, str]]:
        """What works on this machine, as (what, whether it works, detail and way out)."""
        try:
            context = create_context()
        except ComponentError as error:
            return [("opengl", False, str(error))]
        detail = f"OpenGL {context.info['GL_VERSION']} on {context.info['GL_RENDERER']}"
        context.release()
        return [("opengl", True, detail)]

    def _set_frame(self, stage: _Stage, request: RenderRequest) -> _Drawing:
        """Draw the shadow maps, if the Sun shines, and set the uniforms and textures that all tiles of a
        frame share."""
        craft, radiance = request.craft, stage.craft.radiance
        poses = craft.link_poses()
        links = stage.craft.links
        drawing = _Drawing(
            poses, shades(links, craft, poses), layers(links, poses), stage.scene.materials(craft)
        )
        has_sun = bool(np.any(craft.sun_irradiance_rgb_w_m2))
        if has_sun:
            self._draw_shadows(stage, drawing.shades)
        radiance["has_sun"] = has_sun
        radiance["sun_direction"] = tuple(craft.sun_direction_cam)
        radiance["sun_irradiance_rgb_w_m2"] = tuple(craft.sun_irradiance_rgb_w_m2)
        radiance["sun_angular_radius_rad"] = craft.sun_angular_radius_rad
        units = ("shadow_map", "lobe_albedo", "environment", "prefiltered")
        for unit, name in enumerate(units, FREE_UNIT):
            radiance[name] = unit
        stage.lobe_albedo.use(FREE_UNIT + 1)
        radiance["has_environment"] = request.environment is not None
        if request.environment is not None:
            for unit, texture in enumerate(self._maps(stage, request.environment), FREE_UNIT + 2):
                texture.use(unit)
        return drawing

    def _draw_shadows(self, stage: _Stage, shades: Sequence[Shade]) -> None:
        """Draw the shadow maps."""
        stage.context.enable_only(moderngl.DEPTH_TEST)
        stage.context.enable_direct(GL_DEPTH_CLAMP)
        for shade, shadow in zip(shades, stage.shadows, strict=True):
            texels = self._texels(stage, shadow, shade)
            shadow.target.viewport = (0, 0, texels, texels)
            shadow.target.use()
            shadow.target.clear(depth=1.0, viewport=shadow.target.viewport)
            for link, shadow_from_link in shade.casters:
                stage.craft.draw_shadow(link, shadow_from_link)
        stage.context.disable_direct(GL_DEPTH_CLAMP)

    def _texels(self, stage: _Stage, shadow: _ShadowMap, shade: Shade) -> int:
        """Width of the part of a shadow map that is used: its texels need not be finer than samples."""
        camera, widest = stage.scene.camera, shadow.depth.width
        focal = max(camera.fx_px, camera.fy_px) * self.options.samples_per_axis
        if shade.widest_m * focal >= widest * shade.nearest_m:
            return widest
        wanted = int(np.ceil(shade.widest_m * focal / shade.nearest_m))
        return min(max(LEAST_SHADOW_MAP, wanted), widest)

    def _maps(self, stage: _Stage, environment: EnvironmentMap) -> list[Map]:
        """The textures of an environment. Those of the last one are kept, as the images of an exposure
        share one, and making them takes as long as a small image."""
        if self._lit_by is None or self._lit_by[0] is not environment:
            if self._lit_by is not None:
                for texture in self._lit_by[1]:
                    texture.release()
            self._lit_by = (environment, _environment_textures(stage.context, environment))
        return self._lit_by[1]

    def _draw_tile(
        self, stage: _Stage, drawing: _Drawing, x0: int, y0: int, part: PixelBox
    ) -> tuple[Float32Array, Float32Array]:
        """Draw a part of the tile whose corner is at (x0, y0).

        Returns:
            (h, w, 4) radiance and coverage, and (h, w) planar depth in m, 0 where there is none.
        """
        n, camera = self.options.samples_per_axis, stage.scene.camera
        size_px = TILE_SAMPLES // n
        for target in (stage.craft.depth, stage.craft.radiance):
            target["focal_and_centre"] = (
                2 * camera.fx_px / size_px,
                2 * camera.fy_px / size_px,
                2 * (camera.cx_px + 0.5 - x0) / size_px - 1,
                2 * (camera.cy_px + 0.5 - y0) / size_px - 1,
            )
        within = (part.x0 - x0, part.y0 - y0, part.width, part.height)
        scissor = (n * within[0], n * within[1], n * within[2], n * within[3])
        stage.samples.scissor = stage.depths.scissor = scissor
        stage.samples.clear()
        stage.context.enable_only(moderngl.DEPTH_TEST)
        for layer in drawing.layers:
            self._draw_layer(stage, drawing, layer)
        stage.pixels.scissor = within
        stage.pixels.use()
        stage.context.enable_only(moderngl.NOTHING)
        stage.sampled.use(0)
        stage.average.render(moderngl.TRIANGLES, vertices=3)
        image = stage.pixels.read(within, components=4, attachment=0, dtype="f4")
        z_m = stage.pixels.read(within, components=1, attachment=1, dtype="f4")
        shape = (part.height, part.width)
        return (
            np.frombuffer(image, dtype=np.float32).reshape(*shape, 4),
            np.frombuffer(z_m, dtype=np.float32).reshape(shape),
        )

    def _draw_layer(self, stage: _Stage, drawing: _Drawing, layer: Layer) -> None:
        """Draw the samples of a layer over those of the layers behind it."""
        craft = stage.craft
        for target in (craft.depth, craft.radiance):
            target["clip_m"] = layer.clip_m
        # Depth is drawn first so that only visible samples are shaded, which takes most of a frame's
        # time.
        stage.depths.use()
        stage.depths.clear(depth=1.0)
        craft.draw_depth(layer.links, drawing.poses)
        stage.samples.use()
        stage.context.depth_func = "<="
        for link in layer.links:
            shade = drawing.shades[link.body]
            set_matrix(craft.radiance, "shadow_from_cam", shade.shadow_from_cam)
            shadow = stage.shadows[link.body]
            texels = shadow.target.viewport[2]
            craft.radiance["shadow_texel_m"] = shade.widest_m / texels
            craft.radiance["shadow_share"] = texels / shadow.depth.width
            shadow.depth.use(FREE_UNIT)
            craft.draw_radiance(link, drawing.poses, drawing.materials)
        stage.context.depth_func = "<"


def _set_up(context: moderngl.Context, scene: Scene, options: RasterOptions) -> _Stage:
    n = options.samples_per_axis
    tile_px = TILE_SAMPLES // n
    size = (tile_px * n, tile_px * n)
    sampled = context.texture(size, 4, dtype="f4")
    depth = context.depth_renderbuffer(size)
    pixels = [context.texture((tile_px, tile_px), channels, dtype="f4") for channels in (4, 1)]
    share = min(1.0, FULL_SHADOW_MAPS / len(scene.bodies))
    shadow_px = int(options.shadow_map_px * share**0.5)
    average = program(context, "pixel", "pixel")
    average["samples"] = 0
    average["samples_per_axis"] = n
    albedo = lobe_albedo()
    lookup = context.texture(albedo.shape[1::-1], 2, albedo.tobytes(), dtype="f4")
    lookup.repeat_x = lookup.repeat_y = False
    return _Stage(
        context=context,
        scene=scene,
        craft=Craft(context, scene),
        shadows=[_shadow_map(context, shadow_px) for _ in scene.bodies],
        depths=context.framebuffer(depth_attachment=depth),
        samples=context.framebuffer(sampled, depth),
        sampled=sampled,
        pixels=context.framebuffer(pixels),
        average=context.vertex_array(average, []),
        lobe_albedo=lookup,
    )


def _tiles(box: PixelBox, size: int) -> Iterator[tuple[int, int, PixelBox]]:
    """The tiles that a box touches, as the corner of the tile (x0, y0) and the part of it inside the
    box.

    The tiles form a grid over the whole image, so that a pixel gets the same value whatever the box.
    """
    right, bottom = box.x0 + box.width, box.y0 + box.height
    for y0 in range(box.y0 // size * size, bottom, size):
        for x0 in range(box.x0 // size * size, right, size):
            x, y = max(x0, box.x0), max(y0, box.y0)
            yield x0, y0, PixelBox(x, y, min(x0 + size, right) - x, min(y0 + size, bottom) - y)


def _shadow_map(context: moderngl.Context, size_px: int) -> _ShadowMap:
    depth = context.depth_texture((size_px, size_px))
    depth.compare_func = "<="
    depth.filter = (moderngl.LINEAR, moderngl.LINEAR)
    return _ShadowMap(context.framebuffer(depth_attachment=depth), depth)


def _environment_textures(context: moderngl.Context, environment: EnvironmentMap) -> list[Map]:
    radiance = np.ascontiguousarray(environment.radiance_rgb, dtype=np.float32)
    lobes = convolved(radiance)
    plain = context.texture(radiance.shape[1::-1], 3, radiance.tobytes(), dtype="f4")
    layers = context.texture_array(
        (lobes.shape[2], lobes.shape[1], lobes.shape[0]), 3, lobes.tobytes(), dtype="f4"
    )
    for texture in (plain, layers):
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_y = False
    return [plain, layers]
