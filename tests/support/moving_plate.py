"""A plate that moves before the camera, drawn by a renderer in closed form."""

from __future__ import annotations

import numpy as np

from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera
from posse_core._model.craft_state import Rates
from posse_core._model.scene import FrameState, Radiance, RenderRequest, Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft

DISTANCE_M = 10.0
FOCAL_PX = 100.0
WIDTH, HEIGHT = 96, 72


def moving(
    v_m_s: tuple[float, float, float] = (0, 0, 0),
    omega_body: tuple[float, float, float] = (0, 0, 0),
    omega_camera: tuple[float, float, float] = (0, 0, 0),
) -> FrameState:
    """The plate's middle straight ahead; body, camera and inertial axes are parallel at the instant."""
    return FrameState.of(
        index=0,
        t_s=0.0,
        epoch_jd_tt=2459610.5,
        R_cam_from_body=np.eye(3),
        t_body_cam_m=np.array([0.0, 0.0, DISTANCE_M]),
        R_cam_from_eci=np.eye(3),
        R_ecef_from_eci=np.eye(3),
        r_camera_eci_m=np.array([7e6, 0.0, 0.0]),
        r_target_eci_m=np.array([7e6, 0.0, DISTANCE_M]),
        r_sun_eci_m=np.array([1.5e11, 0.0, -1.5e11]),
        r_moon_eci_m=np.array([3.8e8, 0.0, 0.0]),
        solar_flux_w_m2=1361.0,
        sun_fraction_target=1.0,
        sun_fraction_camera=1.0,
        sun_angular_radius_rad=0.00465,
        rates=Rates(*(np.array(x, float) for x in (v_m_s, omega_body, omega_camera))),
    )


def camera(line_time_s: float = 0.0) -> Camera:
    """The centre of the image is the principal point."""
    return Camera(
        WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, 0.036, line_time_s
    )


def plate(half_x_m: float = 2.03, half_y_m: float = 2.52, line_time_s: float = 0.0) -> Scene:
    """A rectangle across the axis, in the body's xy plane; keypoints at its corners."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [half_x_m, half_y_m, 1.0]
    part = Part(
        name="plate",
        vertices_body_m=corners,
        faces=np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
        normals_body=np.tile(np.float32([0, 0, -1]), (4, 1)),
        uv=np.zeros((4, 2), dtype=np.float32),
        material="grey",
    )
    points = {f"corner{i}": corner for i, corner in enumerate(corners)}
    craft = Spacecraft("plate", (part,), {"grey": Material("grey")}, points)
    return Scene(craft, camera(line_time_s))


class PlateRenderer(Renderer):
    """Radiance 1 where an upright plate that does not turn is; pixels at its rim by their share."""

    def open(self, scene: Scene) -> None:
        self.scene = scene
        self.rendered_px = 0

    def render(self, request: RenderRequest) -> Radiance:
        box, K = request.box, self.scene.camera
        self.rendered_px += box.width * box.height
        corners = self.scene.spacecraft.parts[0].vertices_body_m
        low, high = K.project(corners[[0, 2]] + request.craft.t_body_cam_m)

        def share(first: int, count: int, low_px: float, high_px: float) -> np.ndarray:
            pixels = first + np.arange(count)
            return np.clip(np.minimum(pixels + 0.5, high_px) - np.maximum(pixels - 0.5, low_px), 0, 1)

        across = share(box.x0, box.width, low[0], high[0])
        down = share(box.y0, box.height, low[1], high[1])
        coverage = (down[:, None] * across).astype(np.float32)
        return Radiance(box, np.repeat(coverage[..., None], 3, axis=2), coverage)

    def close(self) -> None:
        pass
