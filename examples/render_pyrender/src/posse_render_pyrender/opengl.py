"""pyrender, changed to what a measurement needs: it draws radiance instead of colours for a screen.

Its own buffers and textures have 8 bits, and its shader applies a tone curve. Here both have
floating-point numbers, and ``shaders/mesh.frag`` takes the shader's place. The base class does all else:
it keeps what OpenGL has loaded, draws shadow maps and binds lights and materials.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

import posse_core as posse

os.environ.setdefault("PYOPENGL_PLATFORM", "egl")  # no display; PyOpenGL reads it when it is imported
# pyrender 0.1.45 uses infty, which NumPy 2 has no longer.
np.infty = np.inf  # type: ignore[attr-defined]  # noqa: NPY201

import pyrender  # noqa: E402
from OpenGL import EGL, GL  # noqa: E402
from pyrender.platforms.egl import EGLPlatform  # noqa: E402
from pyrender.shader_program import ShaderProgramCache  # noqa: E402

__all__ = ["GL", "FloatTexture", "Material", "Platform", "RadianceRenderer", "Sun", "pyrender"]

FLAGS = pyrender.RenderFlags.OFFSCREEN | pyrender.RenderFlags.SHADOWS_DIRECTIONAL
SHADERS = Path(__file__).parent / "shaders"


class Platform(EGLPlatform):
    """An OpenGL context of its own. pyrender's also ends the display, which others may still use."""

    def delete_context(self) -> None:
        none = EGL.EGL_NO_SURFACE
        EGL.eglMakeCurrent(self._egl_display, none, none, EGL.EGL_NO_CONTEXT)
        EGL.eglDestroyContext(self._egl_display, self._egl_context)


class FloatTexture(pyrender.Texture):
    """A texture of floating-point numbers, with mipmaps."""

    def __init__(self, values: posse.AnyArray) -> None:
        """Args: values: (h, w, 3), the row at v = 0 first."""
        super().__init__()
        self._values = np.ascontiguousarray(values, dtype=np.float32)

    def _add_to_context(self) -> None:
        height, width = self._values.shape[:2]
        self._texid = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self._texid)
        GL.glTexImage2D(
            *(GL.GL_TEXTURE_2D, 0, GL.GL_RGB16F, width, height, 0, GL.GL_RGB, GL.GL_FLOAT, self._values)
        )
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR)
        GL.glBindTexture(GL.GL_TEXTURE_2D, 0)


class Material(pyrender.MetallicRoughnessMaterial):
    """pyrender's material, and the strength of the reflection at the surface of a non-metal."""

    specular = 1.0


class Sun(pyrender.DirectionalLight):
    """A light with a disc, and a shadow map tight about the scene; of pyrender's a quarter is used."""

    angular_radius_rad = 0.0

    def _get_shadow_camera(self, scene_scale: float) -> pyrender.OrthographicCamera:
        half_m = 0.51 * scene_scale
        # The camera of the map is as far from the middle of the scene as its box is long.
        near_m, far_m = scene_scale - half_m, scene_scale + half_m
        return pyrender.OrthographicCamera(half_m, half_m, znear=near_m, zfar=far_m)


class Programs(ShaderProgramCache):
    """pyrender's shaders, but those that are in the folder ``shaders``."""

    def get_program(self, vertex_shader: str, fragment_shader: str, **others: Any) -> Any:
        own = SHADERS / fragment_shader
        fragment = str(own) if own.exists() else fragment_shader
        return super().get_program(vertex_shader, fragment, **others)


class RadianceRenderer(pyrender.renderer.Renderer):
    """pyrender's renderer with a buffer of four floating-point numbers: radiance, and depth in m.

    Attributes:
        sky: light from all around, as ``shaders/mesh.frag`` takes it; None for none.
    """

    def __init__(self) -> None:
        super().__init__(1, 1)
        self._program_cache = Programs()
        self._main_fb_dims = (0, 0)
        self.sky: FloatTexture | None = None

    def prepare(self, scene: pyrender.Scene) -> None:
        """Load what is new in the scene, and draw its shadow map."""
        self._update_context(scene, FLAGS)
        for node in scene.light_nodes:
            self._shadow_mapping_pass(scene, node, FLAGS)

    def draw(self, scene: pyrender.Scene, width: int, height: int) -> posse.Float32Array:
        """(height, width, 4) radiance, W m⁻² sr⁻¹, and planar depth, m, 0 where there is nothing."""
        self.viewport_width, self.viewport_height = width, height
        return np.asarray(self._forward_pass(scene, FLAGS))

    def _bind_lighting(self, scene: pyrender.Scene, program: Any, node: Any, flags: int) -> None:
        super()._bind_lighting(scene, program, node, flags)
        for light in scene.lights:
            program.set_uniform("sun_angular_radius_rad", light.angular_radius_rad)
        program.set_uniform("has_sky", int(self.sky is not None))
        if self.sky is not None:
            self._bind_texture(self.sky, "sky", program)

    def _bind_and_draw_primitive(self, primitive: Any, pose: Any, program: Any, flags: int) -> None:
        program.set_uniform("specular", primitive.material.specular)
        super()._bind_and_draw_primitive(primitive, pose, program, flags)

    def _configure_main_framebuffer(self) -> None:
        size = self.viewport_width, self.viewport_height
        if self._main_fb_dims == size:
            return
        self._delete_main_framebuffer()
        self._main_cb, self._main_db = GL.glGenRenderbuffers(2)
        self._main_fb = GL.glGenFramebuffers(1)
        # The base class draws to a buffer of several samples per pixel and copies it; here both are one.
        self._main_fb_ms, self._main_cb_ms, self._main_db_ms = (
            self._main_fb,
            self._main_cb,
            self._main_db,
        )
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._main_fb)
        for buffer, numbers, use in (
            (self._main_cb, GL.GL_RGBA32F, GL.GL_COLOR_ATTACHMENT0),
            (self._main_db, GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_ATTACHMENT),
        ):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, numbers, *size)
            GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, use, GL.GL_RENDERBUFFER, buffer)
        self._main_fb_dims = size

    def _read_main_framebuffer(self, scene: pyrender.Scene, flags: int) -> posse.Float32Array:
        width, height = self._main_fb_dims
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
        numbers = GL.glReadPixels(0, 0, width, height, GL.GL_RGBA, GL.GL_FLOAT)
        return np.frombuffer(numbers, dtype=np.float32).reshape(height, width, 4)[::-1]
