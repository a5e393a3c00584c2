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
    """Path tracing with Cycles, in a worker process.

    :meth:`open` starts the worker and :meth:`close` ends it. After a :class:`WorkerLost`, open the
    renderer again.
    """

    def __init__(self, options: BlenderOptions) -> None:
        super().__init__(options)
        self._child: Child | None = None
        self._scene: Scene | None = None
        self._described: dict[str, str] = {}

    def open(self, scene: Scene) -> None:
        """Start the worker and build the scene in it.

        Raises:
            ComponentError: there is no interpreter with bpy, the GPU is absent, or Blender fails.
        """
        self.close()
        interpreter = find_interpreter(self.options)
        self._child = Child(interpreter)
        try:
            answer = self._child.ask(scene_message(scene, self.options), "building the scene")
        except BaseException:
            self.close()
            raise
        self._scene = scene
        self._described = {
            "blender": self._child.blender_version,
            "interpreter": interpreter.path,
            "interpreter_python": self._child.python_version,
            "device": answer.values["device"],
        }

    def render(self, request: RenderRequest) -> Radiance:
        """Render one frame's box.

        Raises:
            WorkerLost: the worker died; the message contains the end of its log.
            ComponentError: Cycles failed, or the renderer is not open.
        """
        if self._child is None or self._scene is None:
            raise ComponentError("blender: the renderer is not open")
        answer = self._child.ask(
            frame_message(request, self._scene, self.options.adaptive_threshold),
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
        """The versions of Blender and its Python, the path of the interpreter, and the device."""
        return self._described

    @property
    def worker_pid(self) -> int | None:
        """Process id of the worker, None when closed."""
        return self._child.pid if self._child is not None else None

    @classmethod
    def doctor(cls, options: BlenderOptions) -> Sequence[tuple[str, bool, str]]:
        """What works on this machine, as (what, whether it works, detail and way out)."""
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

    Its values are the options, the camera, lists of materials and parts, and the list of pieces, each as
    the index of its part and the number of its link. Pieces that are the same share a part. Its arrays
    are named ``part0.vertices_m``, ``material0.base_color_texture`` and so on, after the attributes of
    :class:`~posse_core.Part` and :class:`~posse_core.Material`.
    """
    camera = scene.camera
    arrays: dict[str, AnyArray] = {}
    materials: list[dict[str, Any]] = []
    parts: list[dict[str, Any]] = []
    pieces: list[tuple[int, int]] = []
    numbers: dict[tuple[int, ...], int] = {}
    for piece in scene.pieces:
        material, part = piece.material, piece.part
        key = (id(material),)
        if key not in numbers:
            i = numbers[key] = len(materials)
            names = ("name", "base_color", "metallic", "roughness", "specular")
            materials.append({name: getattr(material, name) for name in names})
            for name in TEXTURES:
                texture = getattr(material, name)
                if texture is not None:
                    arrays[f"material{i}.{name}"] = texture
            if material.patterns:
                arrays[f"material{i}.patterns"] = np.stack(material.patterns)
        both = (id(material), id(part))
        if both not in numbers:
            i = numbers[both] = len(parts)
            parts.append({"name": part.name, "material": numbers[key]})
            arrays[f"part{i}.vertices_m"] = part.vertices_body_m.astype(np.float32)
            arrays[f"part{i}.faces"] = part.faces.astype(np.int32)
            arrays[f"part{i}.normals"] = part.normals_body.astype(np.float32)
            arrays[f"part{i}.uv"] = part.uv.astype(np.float32)
        pieces.append((numbers[both], piece.link))
    intrinsics = ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")
    values = {
        **options.model_dump(exclude={"python", "executable", "adaptive_threshold"}),
        "camera": {key: getattr(camera, key) for key in intrinsics},
        "materials": materials,
        "parts": parts,
        "pieces": pieces,
    }
    return Message("open", values, arrays)


def frame_message(request: RenderRequest, scene: Scene, adaptive_threshold: float) -> Message:
    """The request ``render``.

    Its value ``materials`` has the base colour, the roughness and the index of the pattern of each, in
    the order of the request ``open``.

    Cycles stops sampling a pixel of radiance L when the error of L, divided by √L, is below a threshold.
    This threshold has the unit of √L. The option's value is meant for a white plate of radiance 1, so it
    is multiplied by the square root of a white plate's radiance in the light of this frame.
    """
    craft, box, radii_m = request.craft, request.box, scene.link_radii_m
    ranges_m = np.linalg.norm(craft.link_poses().t_link_cam_m, axis=1)[radii_m > 0]
    reach_m = CLIP_RADII * radii_m[radii_m > 0]
    arrays: dict[str, AnyArray] = {
        **craft.world_poses()._asdict(),
        "sun_direction_world": craft.sun_direction_body,
        "sun_irradiance_rgb_w_m2": craft.sun_irradiance_rgb_w_m2,
    }
    if request.environment is not None:
        arrays["environment"] = request.environment.radiance_rgb
    now = {}
    for piece, material, finish in zip(
        scene.pieces, scene.materials(craft), scene.finishes(craft), strict=True
    ):
        pattern = None if finish is None else finish.pattern
        now[id(piece.material)] = [*material.base_color, material.roughness, pattern]
    values = {
        "materials": list(now.values()),
        "box": [box.x0, box.y0, box.width, box.height],
        "seed": request.seed % 2**31,
        "adaptive_threshold": adaptive_threshold * math.sqrt(_white(request)),
        "sun_angular_radius_rad": craft.sun_angular_radius_rad,
        # Half the nearest distance keeps the near plane in front of all bodies at any angle of view.
        "clip_m": [max(1e-3, float((ranges_m - reach_m).min()) / 2), float((ranges_m + reach_m).max())],
    }
    return Message("render", values, arrays)


def _white(request: RenderRequest) -> float:
    """Radiance in the strongest band, W m⁻² sr⁻¹, of a white plate that faces the Sun and a uniform
    sky."""
    sun = float(request.craft.sun_irradiance_rgb_w_m2.max()) / math.pi
    sky = 0.0 if request.environment is None else float(request.environment.radiance_rgb.mean())
    return sun + sky
