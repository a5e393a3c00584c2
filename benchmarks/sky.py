"""Measures the time of one core for the sky: ``python benchmarks/sky.py`` prints a table in seconds.

The image has 1280 × 960 pixels, 90° wide, at an altitude of 700 km. The first frame of a view is left
out.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from functools import partial
from statistics import median

import cv2
import numpy as np

from posse_core._imaging.image_sensor import ImageSensor
from posse_core._model.camera import Camera
from posse_core._model.scene import FrameState
from posse_core._scenario.sensor import SensorConfig
from posse_core._scenario.sky import SkyConfig
from posse_core._sky.clouds import make_clouds
from posse_core._sky.earth import Earth
from posse_core._sky.environment import environment_map
from posse_core._sky.ground import blue_marble
from posse_core._sky.sky import Sky

CAMERA = Camera(1280, 960, 640.0, 640.0, 639.5, 479.5, 0.036)
VIEWS = {"Earth fills the image": -1.0, "limb": -0.45, "no Earth": 1.0}
REPEATS = 5


def looking(up_share: float) -> FrameState:
    """A state over 35° N, 15° E at noon; ``up_share`` is the sine of the camera's elevation."""
    up = np.array([0.79, 0.21, 0.57])
    up /= np.linalg.norm(up)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    z = up_share * up + np.sqrt(1 - up_share**2) * east
    x = np.cross(z, np.cross(up, east))
    x /= np.linalg.norm(x)
    place = 7.08e6 * up
    return FrameState.of(
        index=0,
        t_s=0.0,
        epoch_jd_tt=2459610.58,
        R_cam_from_body=np.eye(3),
        t_body_cam_m=np.array([0.0, 0.0, 20.0]),
        R_cam_from_eci=np.stack([x, np.cross(z, x), z]),
        R_ecef_from_eci=np.eye(3),
        r_camera_eci_m=place,
        r_target_eci_m=place,
        r_sun_eci_m=1.496e11 * np.array([0.9, 0.3, 0.3]),
        r_moon_eci_m=np.array([0.0, 0.0, -3.844e8]),
        solar_flux_w_m2=1361.0,
        sun_fraction_target=1.0,
        sun_fraction_camera=1.0,
        sun_angular_radius_rad=0.00465,
    )


def seconds(work: Callable[[], object]) -> float:
    """Median processor time of a few calls."""
    times = []
    for _ in range(REPEATS + 1):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return median(times[1:])


def main() -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    start = time.process_time()
    sky = Sky(SkyConfig(), CAMERA, seed=0)
    print(f"{'load maps and make clouds':32}{time.process_time() - start:8.3f} s")
    sensor = ImageSensor(SensorConfig(), CAMERA)
    for name, up_share in VIEWS.items():
        frame = looking(up_share)
        print(f"{'look: ' + name:32}{seconds(partial(sky.look, frame)):8.3f} s")
    frame = looking(VIEWS["limb"])
    view = sky.look(frame)
    earth = Earth(blue_marble(), make_clouds(0))
    print(f"{'environment map':32}{seconds(lambda: environment_map(earth.seen(frame))):8.3f} s")
    print(f"{'expose, mono':32}{seconds(lambda: sensor.expose(view, None, 0.002, 0, 0)):8.3f} s")
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{'peak memory of the process':32}{peak_mib:8.0f} MiB")


if __name__ == "__main__":
    main()
