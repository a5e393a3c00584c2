"""The renderer ``blender``: translates POSSE's scene and frames into messages to its worker."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posse_core import AnyArray, ComponentError, Radiance, Renderer, RenderRequest, Scene
from posse_render_blender.child import Child
from posse_render_blender.interpreter import find_interpreter
from posse_render_blender.options import BlenderOptions
from posse_render_blender.worker.wire import Message

TEXTURES = ("base_color_texture", "metallic_roughness_texture", "normal_texture")
CLIP_RADII = 1.01


class BlenderRenderer(Renderer[BlenderOptions]):
    """Cycles, path traced.

    The worker is started by :meth:`open` and ended by :meth:`close`. After a :class:`ComponentError`
    that says that the worker died, close and open the renderer again.
    """

    def __init__(self, options: BlenderOptions) -> None:
        super().__init__(options)
        self._child: Child | None = None
        self._radius_m = 0.0
        self._described: dict[str, str] = {}

    def open(self, scene: Scene) -> None:
        """Start the worker and build the scene in it.

        Raises:
            ComponentError: no interpreter that has bpy, a GPU that is absent, or a failure of Blender.
        """
        self.close()
        interpreter = find_interpreter(self.options)
        self._child = Child(interpreter)
        try:
            answer = self._child.ask(scene_message(scene, self.options), "building the scene")
        except BaseException:
            self.close()
            raise
        self._radius_m = scene.spacecraft.radius_m
        self._described = {
            "blender": self._child.blender_version,
            "interpreter": interpreter.path,
            "interpreter_python": self._child.python_version,
            "device": answer.values["device"],
        }

    def render(self, request: RenderRequest) -> Radiance:
        """Render one frame's box.

        Raises:
            ComponentError: the worker died or Cycles failed; the message has the end of its log.
        """
        if self._child is None:
            raise ComponentError("blender: the renderer is not open")
        answer = self._child.ask(
            frame_message(request, self._radius_m, self.options.adaptive_threshold),
            f"rendering frame {request.index}",
        )
        return Radiance(
            box=request.box,
            radiance_rgb=answer.arrays["radiance_rgb"],
            coverage=np.clip(answer.arrays["coverage"], 0.0, 1.0),
            depth_m=answer.arrays["depth_m"],
        )

    def close(self) -> None:
        """End the worker."""
        if self._child is not None:
            self._child.close()
            self._child = None

    def describe(self) -> Mapping[str, str]:
        """Versions of Blender and its Python, which one it is, and the device."""
        return self._described

    @property
    def worker_pid(self) -> int | None:
        """Process id of the worker, None when closed."""
        return self._child.pid if self._child is not None else None

    @classmethod
    def doctor(cls, options: BlenderOptions) -> Sequence[tuple[str, bool, str]]:
        """What works on this machine: (what, whether it does, detail with the way out)."""
        out: list[tuple[str, bool, str]] = []
        what = "interpreter"
        try:
            interpreter = find_interpreter(options)
            out.append((what, True, str(interpreter)))
            what = "bpy"
            child = Child(interpreter)
            try:
                out.append(
                    (what, True, f"Blender {child.blender_version}, Python {child.python_version}")
                )
                what = "device"
                answer = child.ask(Message("device", {"device": options.device}), "choosing the device")
                out.append((what, True, str(answer.values["device"])))
            finally:
                child.close()
        except ComponentError as error:
            out.append((what, False, str(error)))
        return out


def scene_message(scene: Scene, options: BlenderOptions) -> Message:
    """The request ``open``.

    Values are the options, the camera, and materials and parts as lists; arrays are named
    ``part0.vertices_body_m``, ``material0.base_color_texture`` and so on, as in
    :class:`~posse_core.Part` and :class:`~posse_core.Material`.
    """
    craft, camera = scene.spacecraft, scene.camera
    names = list(craft.materials)
    arrays: dict[str, AnyArray] = {}
    materials: list[dict[str, Any]] = []
    for i, material in enumerate(craft.materials.values()):
        keys = ("name", "base_color", "metallic", "roughness", "specular")
        materials.append({key: getattr(material, key) for key in keys})
        for key in TEXTURES:
            texture = getattr(material, key)
            if texture is not None:
                arrays[f"material{i}.{key}"] = texture
    parts: list[dict[str, Any]] = []
    for i, part in enumerate(craft.parts):
        parts.append({"name": part.name, "material": names.index(part.material)})
        arrays[f"part{i}.vertices_body_m"] = part.vertices_body_m.astype(np.float32)
        arrays[f"part{i}.faces"] = part.faces.astype(np.int32)
        arrays[f"part{i}.normals_body"] = part.normals_body.astype(np.float32)
        arrays[f"part{i}.uv"] = part.uv.astype(np.float32)
    intrinsics = ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")
    values = {
        **options.model_dump(exclude={"python", "executable", "adaptive_threshold"}),
        "camera": {key: getattr(camera, key) for key in intrinsics},
        "materials": materials,
        "parts": parts,
    }
    return Message("open", values, arrays)


def frame_message(request: RenderRequest, radius_m: float, adaptive_threshold: float) -> Message:
    """The request ``render``; ``radius_m`` is of the sphere that holds the craft.

    Cycles stops at a pixel where the error of its radiance L, over the root of L, is below a threshold.
    That has a unit, so the option's value, which is for a white plate of radiance 1, goes with the
    root of such a plate's in the light of this frame.
    """
    craft, box = request.craft, request.box
    nearest_m = craft.range_m - CLIP_RADII * radius_m
    arrays: dict[str, AnyArray] = {
        "R_cam_from_body": craft.R_cam_from_body,
        "t_body_cam_m": craft.t_body_cam_m,
        "sun_direction_body": craft.sun_direction_body,
        "sun_irradiance_rgb_w_m2": craft.sun_irradiance_rgb_w_m2,
    }
    if request.environment is not None:
        arrays["environment"] = request.environment.radiance_rgb
    values = {
        "box": [box.x0, box.y0, box.width, box.height],
        "seed": request.seed % 2**31,
        "adaptive_threshold": adaptive_threshold * math.sqrt(_white(request)),
        "sun_angular_radius_rad": craft.sun_angular_radius_rad,
        # The near plane must be before the craft at any angle of view: half the nearest distance is.
        "clip_m": [max(1e-3, nearest_m / 2), craft.range_m + CLIP_RADII * radius_m],
    }
    return Message("render", values, arrays)


def _white(request: RenderRequest) -> float:
    """W m⁻² sr⁻¹ in the strongest band, of a white plate that faces the Sun and an even sky."""
    sun = float(request.craft.sun_irradiance_rgb_w_m2.max()) / math.pi
    sky = 0.0 if request.environment is None else float(request.environment.radiance_rgb.mean())
    return sun + sky
