"""The renderer ``mitsuba``.

The world is the spacecraft's body frame, so between frames only the camera, the Sun and the sky
move, and nothing is compiled again. A frame is the mean of passes of eight samples a pixel. In each
the Sun is one direction, so no sample is spent on finding it; over the passes the directions fill
the Sun's disc evenly, which makes penumbras of the right width for the cost of a hard shadow. (A
disc that emits costs 1.7 times as much.)
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from typing import Any

import numpy as np
from pydantic import BaseModel

from posse_core.errors import ComponentError
from posse_core.interfaces.renderer import Renderer
from posse_core.model.arrays import Float32Array, FloatArray
from posse_core.model.camera import PixelBox
from posse_core.model.scene import EnvironmentMap, FrameState, Radiance, RenderRequest, Scene
from posse_core.randomness import generator
from posse_render_mitsuba.options import MitsubaOptions
from posse_render_mitsuba.variants import Choice, choose, load_library

SAMPLES_PER_PASS = 8
FILM_SIZES_PX = (64, 128, 256, 448)
"""Compiled variants compile once for each film size, for about a second; these fit every box."""

_MITSUBA_FROM_CAM: FloatArray = np.diag([-1.0, -1.0, 1.0])
"""OpenCV camera axes → Mitsuba's (x left, y up, z forward), and its own inverse."""


class MitsubaRenderer(Renderer):
    """Path tracing with Mitsuba 3; see the module's text for how the Sun is sampled."""

    options: MitsubaOptions

    def __init__(self, options: BaseModel) -> None:
        super().__init__(options)
        self._choice: Choice | None = None
        self._scene: Scene | None = None
        self._worlds: dict[tuple[int, ...] | None, _World] = {}

    def open(self, scene: Scene) -> None:
        camera = scene.camera
        if not np.isclose(camera.fx_px, camera.fy_px, rtol=1e-9):
            raise ComponentError(
                f"mitsuba has square pixels only: fx is {camera.fx_px:g} px, fy {camera.fy_px:g} px;"
                " choose a camera with fx = fy, or another renderer"
            )
        self._choice = choose(self.options.variant)
        if self._choice.library:
            load_library(self._choice.library)
        self._scene = scene
        self._activate()

    def render(self, request: RenderRequest) -> Radiance:
        if self._scene is None or self._choice is None:
            raise ComponentError("mitsuba: render before open")
        self._activate()
        environment = request.environment
        kind = None if environment is None else environment.radiance_rgb.shape
        if kind not in self._worlds:
            self._worlds[kind] = _World(self._scene, self.options, environment)
        world = self._worlds[kind]
        if environment is not None:
            world.set_environment(environment, request.frame)
        box = request.box
        total = np.zeros((box.height, box.width, 4))
        passes = -(-self.options.spp // SAMPLES_PER_PASS)
        random = generator(request.seed, request.frame.index, "mitsuba")
        directions = _sun_directions_body(request.frame, passes, random.uniform(size=2))
        tiles = [
            (tile, world.sensor(request.frame, tile))
            for tile in _tiles(box, exact=self._choice.variant == "scalar_rgb")
        ]
        for direction in directions:
            world.set_sun(direction, request.frame.sun_irradiance_rgb_w_m2)
            for tile, sensor in tiles:
                image = world.render(sensor, int(random.integers(2**31)))
                _paste(image, tile, total, box)
        total /= passes
        if not np.isfinite(total).all():
            raise ComponentError(
                f"mitsuba: frame {request.frame.index} has radiance that is not finite; another seed"
                " may do, and a material with roughness near 0 is the likely cause"
            )
        return Radiance(
            box,
            radiance_rgb=total[..., :3].astype(np.float32),
            coverage=np.clip(total[..., 3], 0, 1).astype(np.float32),
        )

    def close(self) -> None:
        self._worlds.clear()
        self._scene = None

    def describe(self) -> Mapping[str, str]:
        import mitsuba as mi

        if self._choice is None:
            return {"mitsuba": str(mi.__version__)}
        facts = {"mitsuba": str(mi.__version__), "variant": self._choice.variant}
        if self._choice.library:
            facts["libllvm"] = self._choice.library
        if self._choice.note:
            facts["note"] = self._choice.note
        return facts

    @classmethod
    def doctor(cls, options: BaseModel) -> Sequence[tuple[str, bool, str]]:
        """What works here, with the way out; see :meth:`Renderer.doctor`."""
        version = ("mitsuba", True, metadata.version("mitsuba"))
        try:
            choice = choose(cls(options).options.variant)
        except ComponentError as error:
            return [version, ("variant", False, str(error))]
        detail = ", ".join(filter(None, (choice.variant, choice.library, choice.note)))
        return [version, ("variant", True, detail)]

    def _activate(self) -> None:
        """Set variant and threads, which belong to the whole process."""
        import drjit as dr
        import mitsuba as mi

        assert self._choice is not None
        mi.set_variant(self._choice.variant)
        dr.set_thread_count(self.options.threads or len(os.sched_getaffinity(0)))


class _World:
    """One Mitsuba scene: with or without a sky of one size, kept from frame to frame."""

    def __init__(
        self, scene: Scene, options: MitsubaOptions, environment: EnvironmentMap | None
    ) -> None:
        import mitsuba as mi

        from posse_render_mitsuba.craft import craft_shapes

        self._camera = scene.camera
        self._radius_m = scene.spacecraft.radius_m
        self._sampler = options.sampler
        entries: dict[str, Any] = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": options.max_depth, "hide_emitters": True},
            "sun": {"type": "directional", "irradiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}},
            **craft_shapes(scene.spacecraft),
        }
        if environment is not None:
            entries["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(environment.radiance_rgb.copy())}
        self._scene = mi.load_dict(entries)
        self._parameters = mi.traverse(self._scene)

    def set_environment(self, environment: EnvironmentMap, frame: FrameState) -> None:
        """The sky of this frame; Mitsuba keeps each row with its last column before the first and
        its first after the last."""
        import mitsuba as mi

        rows = environment.radiance_rgb
        padded = np.concatenate([rows[:, -1:], rows, rows[:, :1]], axis=1)
        self._parameters["sky.data"] = mi.TensorXf(np.ascontiguousarray(padded, dtype=np.float32))
        rotation = frame.R_cam_from_body.T @ _MITSUBA_FROM_CAM
        self._parameters["sky.to_world"] = mi.Transform4f(_homogeneous(rotation, np.zeros(3)))
        self._parameters.update()

    def set_sun(self, direction_body: FloatArray, irradiance_rgb_w_m2: FloatArray) -> None:
        """Sunlight from one direction (3,) that gives (3,) W/m² on a plate facing it."""
        import mitsuba as mi

        rotation = _rotation_with_z(-direction_body)
        self._parameters["sun.to_world"] = mi.Transform4f(_homogeneous(rotation, np.zeros(3)))
        self._parameters["sun.irradiance.value"] = mi.Color3f(*map(float, irradiance_rgb_w_m2))
        self._parameters.update()

    def sensor(self, frame: FrameState, tile: PixelBox) -> Any:
        """A camera whose film is the tile, which may reach over the image's border."""
        import mitsuba as mi

        camera = self._camera
        rotation = frame.R_cam_from_body.T
        near_m, far_m = _clip_distances_m(frame.range_m, self._radius_m)
        to_world = _homogeneous(rotation @ _MITSUBA_FROM_CAM, -rotation @ frame.t_body_cam_m)
        return mi.load_dict(
            {
                "type": "perspective",
                "fov_axis": "x",
                "fov": float(np.degrees(2 * np.arctan(tile.width / (2 * camera.fx_px)))),
                "principal_point_offset_x": _offset(camera.cx_px - tile.x0, tile.width),
                "principal_point_offset_y": _offset(camera.cy_px - tile.y0, tile.height),
                "near_clip": near_m,
                "far_clip": far_m,
                "to_world": mi.ScalarTransform4f(to_world),
                "sampler": {"type": self._sampler, "sample_count": SAMPLES_PER_PASS},
                "film": {
                    "type": "hdrfilm",
                    "width": tile.width,
                    "height": tile.height,
                    "pixel_format": "rgba",
                    "component_format": "float32",
                    "rfilter": {"type": "box"},  # any other would make the sums' order, so bits, vary
                },
            }
        )

    def render(self, sensor: Any, seed: int) -> FloatArray:
        """(h, w, 4) radiance and coverage of one pass."""
        import mitsuba as mi

        image = mi.render(self._scene, sensor=sensor, seed=mi.UInt32(seed), spp=SAMPLES_PER_PASS)
        return np.asarray(np.array(image), dtype=np.float64)


def _sun_directions_body(frame: FrameState, count: int, shift: FloatArray) -> FloatArray:
    """(count, 3) directions spread evenly over the Sun's disc, moved about by ``shift`` (2,) in 0 … 1.

    Vogel's sunflower (1979): even over the area, and seen along any diameter.
    """
    place = np.arange(count)
    radius = np.sqrt((place + shift[0]) / count) * np.tan(frame.sun_angular_radius_rad)
    angle = np.pi * (3 - np.sqrt(5)) * place + 2 * np.pi * shift[1]
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.ones(count)], axis=-1)
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    return np.asarray(local @ _rotation_with_z(frame.sun_direction_body).T)


def _tiles(box: PixelBox, *, exact: bool) -> Iterator[PixelBox]:
    """The box itself, or square films of one size that cover it and may reach over it."""
    if exact:
        yield box
        return
    largest = FILM_SIZES_PX[-1]
    columns, rows = -(-box.width // largest), -(-box.height // largest)
    need = max(-(-box.width // columns), -(-box.height // rows))
    size = next(size for size in FILM_SIZES_PX if size >= need)
    for row in range(-(-box.height // size)):
        for column in range(-(-box.width // size)):
            yield PixelBox(box.x0 + column * size, box.y0 + row * size, size, size)


def _paste(image: FloatArray, tile: PixelBox, total: FloatArray, box: PixelBox) -> None:
    """Add to the box's sum what of the tile lies in it."""
    y, x = tile.y0 - box.y0, tile.x0 - box.x0
    part = total[y : y + tile.height, x : x + tile.width]
    part += image[: part.shape[0], : part.shape[1]]


def _offset(principal_px: float, size_px: int) -> float:
    return -((principal_px + 0.5) / size_px - 0.5)


def _clip_distances_m(range_m: float, radius_m: float) -> tuple[float, float]:
    nearest = range_m - 1.01 * radius_m
    return max(nearest, 1e-3 * radius_m), range_m + 1.01 * radius_m


def _rotation_with_z(z: FloatArray) -> FloatArray:
    """(3, 3) rotation whose third column is the unit vector ``z``."""
    helper = np.eye(3)[np.argmin(np.abs(z))]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _homogeneous(rotation: FloatArray, translation: FloatArray) -> Float32Array:
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix
