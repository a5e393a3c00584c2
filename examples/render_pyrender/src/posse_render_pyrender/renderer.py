"""The renderer ``pyrender``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata

import numpy as np

import posse_core as posse
from posse_render_pyrender.opengl import (
    GL,
    FloatTexture,
    Material,
    Platform,
    RadianceRenderer,
    Sun,
    pyrender,
)
from posse_render_pyrender.options import PyrenderOptions
from posse_render_pyrender.sky import layers

GL_FROM_CAM = np.diag([1.0, -1.0, -1.0])
"""OpenGL's cameras look along −z with y up."""
NEAREST_M, FARTHEST_M = 1e-3, 1e6
"""What is drawn; the precision does not depend on them."""
TILE_PX = 512
"""Images are drawn in tiles of this size, because buffers of many samples are large."""
WAY_OUT = "install an EGL driver (Debian, Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri)"


class PyrenderRenderer(posse.Renderer[PyrenderOptions]):
    """pyrender through EGL, which needs no display."""

    def __init__(self, options: PyrenderOptions) -> None:
        super().__init__(options)
        self._platform: Platform | None = None
        self._described: dict[str, str] = {}

    def open(self, scene: posse.Scene) -> None:
        """Create an OpenGL context, and a scene of pyrender whose world axes are the camera's.

        Raises:
            posse_core.ComponentError: there is no EGL driver that supports OpenGL 4.1.
        """
        self.close()
        self._platform = _context()
        self._described = {
            "pyrender": metadata.version("pyrender"),
            "opengl": GL.glGetString(GL.GL_VERSION).decode(),
            "device": GL.glGetString(GL.GL_RENDERER).decode(),
        }
        self._renderer = RadianceRenderer()
        self._scene = scene
        self._drawn = pyrender.Scene(bg_color=np.zeros(4), ambient_light=np.zeros(3))
        self._view = pyrender.IntrinsicsCamera(1, 1, 0, 0, NEAREST_M, FARTHEST_M)
        self._drawn.add(self._view)
        self._sun = Sun()
        self._sun_node = self._drawn.add(self._sun)
        self._textures = _Textures()
        self._nodes = [self._drawn.add(_mesh(piece, self._textures)) for piece in scene.pieces]

    def render(self, request: posse.RenderRequest) -> posse.Radiance:
        """Render one frame's box."""
        if self._platform is None:
            raise posse.ComponentError("pyrender: the renderer is not open")
        self._platform.make_current()
        self._place(request.craft)
        if request.environment is not None:
            self._renderer.sky = FloatTexture(layers(request.environment))
            self._renderer.sky._add_to_context()
        self._renderer.prepare(self._drawn)
        box, n = request.box, self.options.samples_per_axis
        image = np.empty((box.height, box.width, 4), dtype=np.float32)
        depth_m = np.empty((box.height, box.width), dtype=np.float32)
        for tile in _tiles(box):
            rows, columns = posse.PixelBox(
                tile.x0 - box.x0, tile.y0 - box.y0, tile.width, tile.height
            ).slices
            samples = self._draw(tile).reshape(tile.height, n, tile.width, n, 4)
            covered = samples[..., 3] > 0
            image[rows, columns, :3] = samples[..., :3].mean(axis=(1, 3))
            image[rows, columns, 3] = covered.mean(axis=(1, 3))
            depth_m[rows, columns] = samples[:, n // 2, :, n // 2, 3]
        if self._renderer.sky is not None:
            self._renderer.sky.delete()
            self._renderer.sky = None
        return posse.Radiance(
            box=box,
            radiance_rgb=np.ascontiguousarray(image[..., :3]),
            coverage=np.ascontiguousarray(image[..., 3]),
            depth_m=np.where(depth_m > 0, depth_m, np.float32(np.nan)),
        )

    def close(self) -> None:
        """Free what OpenGL has loaded, and the context."""
        if self._platform is not None:
            self._platform.make_current()
            self._renderer.delete()
            self._platform.delete_context()
            self._platform = None

    def describe(self) -> Mapping[str, str]:
        """The versions of pyrender and OpenGL, and the device that renders."""
        return self._described

    @classmethod
    def doctor(cls, options: PyrenderOptions) -> Sequence[tuple[str, bool, str]]:
        """Whether OpenGL works on this machine."""
        try:
            platform = _context()
        except posse.ComponentError as error:
            return [("opengl", False, str(error))]
        platform.delete_context()
        return [("opengl", True, "")]

    def _place(self, craft: posse.CraftState) -> None:
        """Set what changes from frame to frame: poses, sunlight and materials."""
        self._sun.color = craft.sun_irradiance_rgb_w_m2
        self._sun.angular_radius_rad = craft.sun_angular_radius_rad
        towards_sun = posse.R_with_z(GL_FROM_CAM @ craft.sun_direction_cam)
        self._drawn.set_pose(self._sun_node, _pose(towards_sun, np.zeros(3)))
        R, t_m = craft.link_poses()
        materials = self._scene.materials(craft)
        for piece, node, material in zip(self._scene.pieces, self._nodes, materials, strict=True):
            pose = _pose(GL_FROM_CAM @ R[piece.link], GL_FROM_CAM @ t_m[piece.link])
            self._drawn.set_pose(node, pose)
            drawn = node.mesh.primitives[0].material
            drawn.baseColorFactor = np.array([*material.base_color, 1.0])
            drawn.metallicFactor = material.metallic
            drawn.roughnessFactor = material.roughness
            drawn.specular = material.specular
            drawn.baseColorTexture = self._textures.of(material.base_color_texture, srgb=True)

    def _draw(self, tile: posse.PixelBox) -> posse.Float32Array:
        """(h n, w n, 4) samples of a tile, with the rows of all pixels' samples one after another."""
        camera, n = self._scene.camera, self.options.samples_per_axis
        self._view.fx, self._view.fy = n * camera.fx_px, n * camera.fy_px
        # pyrender counts from the corner of the top-left pixel, POSSE from its centre.
        self._view.cx = n * (camera.cx_px + 0.5 - tile.x0)
        self._view.cy = n * (camera.cy_px + 0.5 - tile.y0)
        return self._renderer.draw(self._drawn, n * tile.width, n * tile.height)


def _context() -> Platform:
    """An OpenGL context, current in this thread."""
    try:
        platform = Platform(1, 1)
        platform.init_context()
    except Exception as error:  # PyOpenGL raises what it likes, pyrender bare assertions
        reason = " ".join(str(error).split()) or type(error).__name__
        raise posse.ComponentError(f"pyrender: no OpenGL 4.1 through EGL: {reason}; {WAY_OUT}") from None
    return platform


class _Textures:
    """The textures of a scene's materials. The scene keeps their images, whose identity stays theirs."""

    def __init__(self) -> None:
        self._made: dict[int, FloatTexture] = {}

    def of(self, image: posse.AnyArray | None, srgb: bool = False) -> FloatTexture | None:
        if image is None:
            return None
        if id(image) not in self._made:
            values = posse.linear_from_srgb(image / 255) if srgb else image / 255
            spare = ((0, 0), (0, 0), (0, 3 - image.shape[2]))
            self._made[id(image)] = FloatTexture(np.pad(values, spare)[::-1])
        return self._made[id(image)]


def _mesh(piece: posse.Piece, textures: _Textures) -> pyrender.Mesh:
    """A part with its material."""
    part, material = piece.part, piece.material
    primitive = pyrender.Primitive(
        positions=part.vertices_body_m,
        normals=part.normals_body,
        texcoord_0=part.uv,
        # Each face is there twice, once for each side, as pyrender's shadow maps leave out the backs.
        indices=np.vstack([part.faces, part.faces[:, ::-1]]),
        material=Material(
            baseColorTexture=textures.of(material.base_color_texture, srgb=True),
            metallicRoughnessTexture=textures.of(material.metallic_roughness_texture),
            normalTexture=textures.of(material.normal_texture),
        ),
    )
    return pyrender.Mesh([primitive])


def _pose(R: posse.FloatArray, t_m: posse.FloatArray) -> posse.FloatArray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R, t_m
    return pose


def _tiles(box: posse.PixelBox) -> Iterator[posse.PixelBox]:
    """The parts of a box in the tiles of a grid over the whole image, so that a pixel is computed by the
    same numbers whatever the box."""
    right, bottom = box.x0 + box.width, box.y0 + box.height
    for y0 in range(box.y0 // TILE_PX * TILE_PX, bottom, TILE_PX):
        for x0 in range(box.x0 // TILE_PX * TILE_PX, right, TILE_PX):
            x, y = max(x0, box.x0), max(y0, box.y0)
            yield posse.PixelBox(x, y, min(x0 + TILE_PX, right) - x, min(y0 + TILE_PX, bottom) - y)
