# SPDX-License-Identifier: GPL-3.0-or-later
"""The bodies of a scene in Blender: built once, updated for each frame and rendered by Cycles into float
arrays.

Blender's world axes are those of ``posse_core.WorldPoses``, so for a rigid target only the camera, the
Sun and the sky move between frames. Where there are joints or other bodies, objects get new matrices.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Any

import bpy
import cycles
import numpy as np
from mathutils import Matrix, Vector

SENSOR_WIDTH_MM = 36.0
BASE_COLOR_TEXTURE = "base_color_texture"
BACKGROUND_DEPTH_M = 1e9
"""Depths from here on mean that the pixel's centre sees nothing; Cycles writes 1e10 there."""
BLENDER_FROM_CV = np.diag([1.0, -1.0, -1.0])
"""Rotates OpenCV camera axes to Blender's: the camera looks along −z, with +y up."""
ENVIRONMENT_FROM_CAM = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotates camera axes to those of Blender's equirectangular map: +z up, +x at the centre, +y to the
left."""

_passes: dict[str, np.ndarray] = {}
"""The passes of the last render, kept here because Blender gives them only to its render engine."""


def _keep_passes(render: Callable[..., None]) -> Callable[..., None]:
    def wrapped(engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> None:
        render(engine, depsgraph)
        result = engine.get_result()
        for render_pass in result.layers[0].passes:
            if render_pass.name in ("Combined", "Depth"):
                flat = np.empty(
                    result.resolution_x * result.resolution_y * render_pass.channels, dtype=np.float32
                )
                render_pass.rect.foreach_get(flat)
                shape = (result.resolution_y, result.resolution_x, render_pass.channels)
                _passes[render_pass.name] = flat.reshape(shape)[::-1]

    return wrapped


cycles.CyclesRender.render = _keep_passes(cycles.CyclesRender.render)


def choose_device(device: str) -> str:
    """Make Cycles compute on ``cpu``, or on all GPUs of a kind.

    Returns:
        The device in words.

    Raises:
        RuntimeError: there is no such GPU, or this Blender does not support the kind.
    """
    if device == "cpu":
        return "cpu"
    kind = device.upper()
    preferences = bpy.context.preferences.addons["cycles"].preferences
    try:
        preferences.compute_device_type = kind
    except TypeError:
        raise RuntimeError(f"this Blender does not support {device}; use device: cpu") from None
    preferences.refresh_devices()
    names = []
    for found in preferences.devices:
        found.use = found.type == kind
        if found.use:
            names.append(found.name)
    if not names:
        raise RuntimeError(f"no GPU for {device} was found; use device: cpu")
    return f"{device}: {', '.join(names)}"


class CyclesScene:
    """The Blender scene of one run."""

    def __init__(self, values: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        """Build the scene from the message ``open``, which ``renderer.scene_message`` describes."""
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self._scene = bpy.context.scene
        self._sky: bpy.types.World | None = None
        self._dark = _world("dark")
        self._dark.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
        self.device = choose_device(values["device"])
        self._set_up_cycles(values)
        self._camera = self._add_camera(**values["camera"])
        self._sun = self._add_sun()
        self._materials = [
            _material(material, arrays, f"material{i}.")
            for i, material in enumerate(values["materials"])
        ]
        self._finishes = [[*each["base_color"], each["roughness"], None] for each in values["materials"]]
        # Of each material: the image of its own texture, and those of its patterns.
        self._images = [
            {None: _own_image(material), **_patterns(arrays.get(f"material{i}.patterns", ()))}
            for i, material in enumerate(self._materials)
        ]
        meshes = []
        for i, part in enumerate(values["parts"]):
            mesh = _mesh(part["name"], arrays, f"part{i}.")
            mesh.materials.append(self._materials[part["material"]])
            meshes.append(mesh)
        self._pieces: list[tuple[bpy.types.Object, int]] = []
        for i, link in values["pieces"]:
            piece = bpy.data.objects.new(meshes[i].name, meshes[i])
            self._scene.collection.objects.link(piece)
            self._pieces.append((piece, link))

    def render(self, values: dict[str, Any], arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Render the frame of the message ``render``.

        Returns:
            Of the message's box: ``radiance_rgb`` (h, w, 3), ``coverage`` (h, w) and ``depth_m`` (h, w).
        """
        self.place(values, arrays)
        self._crop(*values["box"])
        settings = self._scene.cycles
        settings.seed = values["seed"]
        settings.use_adaptive_sampling = values["adaptive_threshold"] > 0
        settings.adaptive_threshold = values["adaptive_threshold"]
        # With persistent data, Cycles reads its settings again only if the scene is tagged as updated.
        self._scene.update_tag()
        _passes.clear()
        bpy.ops.render.render()
        if not _passes:
            raise RuntimeError("Cycles returned no image")
        combined, depth_m = _passes["Combined"], _passes["Depth"][..., 0]
        return {
            "radiance_rgb": combined[..., :3],
            "coverage": combined[..., 3],
            "depth_m": np.where(depth_m < BACKGROUND_DEPTH_M, depth_m, np.float32(np.nan)),
        }

    def place(self, values: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        """Put camera, bodies, materials and light as they are in the frame of the message ``render``."""
        R_cam_from_world = arrays["R_cam_from_world"]
        camera_from_world = np.eye(4)
        camera_from_world[:3, :3] = BLENDER_FROM_CV @ R_cam_from_world
        camera_from_world[:3, 3] = BLENDER_FROM_CV @ arrays["t_world_cam_m"]
        self._camera.matrix_world = Matrix(np.linalg.inv(camera_from_world).tolist())
        self._camera.data.clip_start, self._camera.data.clip_end = values["clip_m"]
        self._move(arrays["R_world_from_link"], arrays["t_link_world_m"])
        for i, finish in enumerate(values["materials"]):
            if finish != self._finishes[i]:
                self._finishes[i] = finish
                *color, roughness, pattern = finish
                _finish(self._materials[i], color, roughness, self._images[i][pattern])
        self._point_sun(arrays["sun_direction_world"], arrays["sun_irradiance_rgb_w_m2"], values)
        self._set_sky(arrays.get("environment"), R_cam_from_world)

    def _move(self, R_world_from_link: np.ndarray, t_link_world_m: np.ndarray) -> None:
        """Put the pieces where their links are. A rigid target stays where it is built."""
        if len(t_link_world_m) == 1:
            return
        for piece, link in self._pieces:
            turn = Matrix(R_world_from_link[link].tolist()).to_4x4()
            piece.matrix_world = Matrix.Translation(t_link_world_m[link]) @ turn

    def _set_up_cycles(self, values: dict[str, Any]) -> None:
        render, settings = self._scene.render, self._scene.cycles
        render.engine = "CYCLES"
        render.film_transparent = True
        render.use_persistent_data = True
        render.use_compositing = render.use_sequencer = False
        threads = values["threads"] or int(os.environ.get("POSSE_THREADS") or 0)
        render.threads_mode = "FIXED" if threads else "AUTO"
        if threads:
            # With one thread, Cycles' scheduler (TBB) keeps a second one busy after the first frame.
            render.threads = max(threads, 2)
        settings.device = "CPU" if self.device == "cpu" else "GPU"
        settings.samples = values["spp"]
        settings.use_denoising = values["denoiser"] != "none"
        if settings.use_denoising:
            settings.denoiser = "OPENIMAGEDENOISE"  # some distributions build Blender without it
        settings.pixel_filter_type, settings.filter_width = "BOX", 1.0
        for kind in ("max", "diffuse", "glossy", "transmission", "volume"):
            setattr(settings, f"{kind}_bounces", values["max_bounces"])
        # By default Cycles leaves out some light to reduce noise; here all light must be counted.
        settings.sample_clamp_direct = settings.sample_clamp_indirect = 0.0
        settings.blur_glossy = 0.0
        settings.caustics_reflective = settings.caustics_refractive = True
        settings.light_sampling_threshold = 0.0
        settings.use_auto_tile = False  # tiles would be written to disk
        self._scene.view_layers[0].use_pass_z = True

    def _add_camera(
        self, width_px: int, height_px: int, fx_px: float, fy_px: float, cx_px: float, cy_px: float
    ) -> bpy.types.Object:
        render = self._scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = width_px, height_px, 100
        y_scale = fx_px / fy_px
        render.pixel_aspect_x, render.pixel_aspect_y = max(1.0, 1.0 / y_scale), max(1.0, y_scale)
        data = bpy.data.cameras.new("camera")
        data.sensor_fit, data.sensor_width = "HORIZONTAL", SENSOR_WIDTH_MM
        data.lens = fx_px * SENSOR_WIDTH_MM / width_px
        data.shift_x = -(cx_px + 0.5 - width_px / 2) / width_px
        data.shift_y = (cy_px + 0.5 - height_px / 2) / width_px * y_scale
        self._scene.camera = bpy.data.objects.new("camera", data)
        self._scene.collection.objects.link(self._scene.camera)
        return self._scene.camera

    def _add_sun(self) -> bpy.types.Object:
        sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
        sun.visible_camera = False  # the Sun's own image belongs to the sky
        self._scene.collection.objects.link(sun)
        return sun

    def _point_sun(
        self, direction_world: np.ndarray, irradiance: np.ndarray, values: dict[str, Any]
    ) -> None:
        strongest = float(irradiance.max())
        self._sun.data.energy = strongest  # W/m² on a plate that faces it
        self._sun.data.color = irradiance / strongest if strongest > 0 else (1.0, 1.0, 1.0)
        self._sun.data.angle = 2 * values["sun_angular_radius_rad"]
        self._sun.rotation_mode = "QUATERNION"
        self._sun.rotation_quaternion = Vector(direction_world).to_track_quat("Z", "Y")

    def _set_sky(self, radiance_rgb: np.ndarray | None, R_cam_from_world: np.ndarray) -> None:
        if radiance_rgb is None:
            self._scene.world = self._dark
            return
        if self._sky is None:
            self._sky = _sky()
        nodes = self._sky.node_tree.nodes
        # With persistent data, Cycles keeps the old pixels of an image that is refilled, so the image is
        # replaced.
        old = nodes["Environment Texture"].image
        nodes["Environment Texture"].image = _image("sky", radiance_rgb, "Non-Color")
        if old is not None:
            bpy.data.images.remove(old)
        turn = Matrix((ENVIRONMENT_FROM_CAM @ R_cam_from_world).tolist())
        # Size of the table for importance sampling of the sky; the automatic size costs 3 CPU-s per
        # frame.
        self._sky.cycles.sampling_method = "MANUAL"
        self._sky.cycles.sample_map_resolution = radiance_rgb.shape[1]
        nodes["Mapping"].inputs["Rotation"].default_value = turn.to_euler("XYZ")
        self._scene.world = self._sky

    def _crop(self, x0: int, y0: int, width: int, height: int) -> None:
        render = self._scene.render
        render.use_border = render.use_crop_to_border = True
        # Blender truncates the border to whole pixels. The quarter of a pixel prevents the loss of a
        # whole one by float32 rounding.
        render.border_min_x = (x0 + 0.25) / render.resolution_x
        render.border_max_x = min(1.0, (x0 + width + 0.25) / render.resolution_x)
        bottom = render.resolution_y - y0 - height
        render.border_min_y = (bottom + 0.25) / render.resolution_y
        render.border_max_y = min(1.0, (bottom + height + 0.25) / render.resolution_y)


def _mesh(name: str, arrays: dict[str, np.ndarray], prefix: str) -> bpy.types.Mesh:
    vertices, faces = arrays[prefix + "vertices_m"], arrays[prefix + "faces"]
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    # This drops triangles that use a vertex twice, so the loops are read back afterwards.
    mesh.validate()
    corners = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    uv = np.ascontiguousarray(arrays[prefix + "uv"][corners])
    mesh.uv_layers.new(name="uv").data.foreach_set("uv", uv.ravel())
    mesh.normals_split_custom_set_from_vertices(arrays[prefix + "normals"])
    return mesh


def _material(values: dict[str, Any], arrays: dict[str, np.ndarray], prefix: str) -> bpy.types.Material:
    """A glTF metallic-roughness material as a Principled BSDF."""
    material = bpy.data.materials.new(values["name"])
    if material.node_tree is None:
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    bsdf = nodes["Principled BSDF"]
    bsdf.distribution = "GGX"
    bsdf.inputs["IOR"].default_value = 1.5
    bsdf.inputs["Specular IOR Level"].default_value = 0.5 * values["specular"]
    bsdf.inputs["Base Color"].default_value = (*values["base_color"], 1.0)
    bsdf.inputs["Metallic"].default_value = values["metallic"]
    bsdf.inputs["Roughness"].default_value = values["roughness"]

    def texture(key: str, colorspace: str) -> bpy.types.NodeSocket | None:
        pixels = arrays.get(prefix + key)
        if pixels is None:
            return None
        node = nodes.new("ShaderNodeTexImage")
        node.name = key
        node.image = _image(key, pixels, colorspace)
        return node.outputs["Color"]

    color = texture(BASE_COLOR_TEXTURE, "sRGB")
    if color is not None:
        product = nodes.new("ShaderNodeVectorMath")
        product.name = "Base Color factor"
        product.operation = "MULTIPLY"
        links.new(color, product.inputs[0])
        product.inputs[1].default_value = values["base_color"]
        links.new(product.outputs[0], bsdf.inputs["Base Color"])
    both = texture("metallic_roughness_texture", "Non-Color")
    if both is not None:
        split = nodes.new("ShaderNodeSeparateColor")
        links.new(both, split.inputs[0])
        for channel, name in enumerate(("Metallic", "Roughness")):
            product = nodes.new("ShaderNodeMath")
            product.name = f"{name} factor"
            product.operation = "MULTIPLY"
            links.new(split.outputs[channel], product.inputs[0])
            product.inputs[1].default_value = values[name.lower()]
            links.new(product.outputs[0], bsdf.inputs[name])
    normal = texture("normal_texture", "Non-Color")
    if normal is not None:
        turn = nodes.new("ShaderNodeNormalMap")
        turn.uv_map = "uv"
        links.new(normal, turn.inputs["Color"])
        links.new(turn.outputs[0], bsdf.inputs["Normal"])
    return material


def _own_image(material: bpy.types.Material) -> bpy.types.Image | None:
    """The texture of a material's base colour."""
    node = material.node_tree.nodes.get(BASE_COLOR_TEXTURE)
    return None if node is None else node.image


def _patterns(textures: Iterable[np.ndarray]) -> dict[int, bpy.types.Image]:
    return {k: _image(f"pattern {k}", pixels, "sRGB") for k, pixels in enumerate(textures)}


def _finish(
    material: bpy.types.Material, color: list[float], roughness: float, image: bpy.types.Image | None
) -> None:
    """Set the factors of a material in a frame, and the image of its base colour if it has one."""
    nodes = material.node_tree.nodes
    if image is not None:
        nodes[BASE_COLOR_TEXTURE].image = image
    own = nodes["Principled BSDF"].inputs
    if "Base Color factor" in nodes:
        nodes["Base Color factor"].inputs[1].default_value = color
    else:
        own["Base Color"].default_value = (*color, 1.0)
    rough = nodes["Roughness factor"].inputs[1] if "Roughness factor" in nodes else own["Roughness"]
    rough.default_value = roughness


def _world(name: str) -> bpy.types.World:
    world = bpy.data.worlds.new(name)
    if world.node_tree is None:
        world.use_nodes = True
    return world


def _sky() -> bpy.types.World:
    world = _world("sky")
    nodes, links = world.node_tree.nodes, world.node_tree.links
    coordinates, turn = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeMapping")
    texture = nodes.new("ShaderNodeTexEnvironment")
    links.new(coordinates.outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])
    return world


def _image(name: str, pixels: np.ndarray, colorspace: str) -> bpy.types.Image:
    """A Blender image from (H, W, 1 … 3) uint8 or float32 pixels whose row 0 is at the top."""
    height, width, channels = pixels.shape
    is_float = pixels.dtype != np.uint8
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=is_float)
    image.colorspace_settings.name = colorspace
    rgba = np.zeros((height, width, 4), dtype=np.float32)
    rgba[..., 3] = 1.0
    rgba[..., :channels] = pixels[::-1] if is_float else pixels[::-1] / np.float32(255)
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    return image
