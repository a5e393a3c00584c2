"""Making one frame: geometry → labels, radiance → image, files on disk. Lives in a worker."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from pydantic import ValidationError

from posse_core._arrays import AnyArray
from posse_core._environment.time import Epoch
from posse_core._errors import ComponentError
from posse_core._files.store import open_store
from posse_core._files.trajectory import load_trajectory
from posse_core._geometry.raycast import RayCaster
from posse_core._interfaces.annotator import Annotator
from posse_core._interfaces.executor import FrameMade
from posse_core._interfaces.renderer import Renderer
from posse_core._model.camera import Camera
from posse_core._model.label_line import LabelLine, first_fault
from posse_core._model.labels import View
from posse_core._model.scene import FrameState, Radiance, Scene
from posse_core._plugins.loading import load_plugins
from posse_core._run.light import CraftLight
from posse_core._scenario.component import create
from posse_core._scenario.load import load_scenario
from posse_core._sensor.lens import LensRenderer
from posse_core._sensor.sensor import Sensor
from posse_core._sky.sky import Sky, SkyView
from posse_core._trajectory.state import frame_state

RENDERER_FILE = "renderer.json"
"""What the renderer says of itself, for the manifest."""


class FrameMaker:
    """Makes the frames of the dataset at ``place``, a path or URL, from its scenario and trajectory."""

    def __init__(self, place: str) -> None:
        self._store = open_store(place)
        self._registry = registry = load_plugins().registry
        with self._store.local_copy("scenario.yaml") as path:
            scenario = load_scenario(str(path), registry)
        self._seed = scenario.seed
        self._constants = scenario.constants
        with self._store.local_copy("trajectory.npz") as path:
            self._trajectory = load_trajectory(path)
        self._epoch = Epoch.from_iso(self._trajectory.epoch_utc)
        camera = scenario.camera.camera()
        craft = create(registry, "scene", scenario.target).build()
        self._scene = Scene(craft, camera)
        self._geometry = RayCaster(self._scene)
        self._annotators: dict[str, Annotator] = {
            choice.name: create(registry, "annotator", choice) for choice in scenario.annotators
        }
        for name in self._annotators.keys() & LabelLine.model_fields.keys():
            if not registry.is_core("annotator", name):
                raise ComponentError(f"annotator {name!r}: a label of POSSE's own has this name")
        self._sky = Sky(scenario.sky, camera, scenario.seed)
        self._sensor_config = scenario.sensor
        self._sensor = Sensor(scenario.sensor, camera)
        self._renderer: Renderer = LensRenderer(create(registry, "renderer", scenario.renderer))
        self._renderer.open(self._scene)
        self._craft = CraftLight(self._renderer, self._geometry, self._sky, camera, scenario.seed)
        said = json.dumps(dict(self._renderer.describe()), indent=2, ensure_ascii=False)
        self._store.write(RENDERER_FILE, f"{said}\n".encode())

    def make(self, index: int) -> FrameMade:
        """Make one frame and write its files."""
        frame = frame_state(self._trajectory, index, self._constants)
        view = self._geometry.view(frame.craft)
        labels, arrays = self.annotate(frame, view)
        image, exposure_s = self.expose(frame)
        image_file, truth_file = f"images/{index:06d}.png", f"truth/{index:06d}.npz"
        files = {image_file: _png(image)}
        if arrays:
            files[truth_file] = _npz(arrays)
        for name, data in files.items():
            self._store.write(name, data)
        digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
        last = {"exposure_s": exposure_s, "image": image_file, "truth": truth_file if arrays else None}
        return FrameMade(labels.model_copy(update=last), digests)

    def annotate(self, frame: FrameState, view: View) -> tuple[LabelLine, dict[str, AnyArray]]:
        """Labels of a frame, and its full-size arrays (H, W, ...) by name.

        What the core's annotators make are labels of the line itself; what another annotator makes
        stands under the annotator's own name.

        Raises:
            ComponentError: an annotator makes what cannot be written, or an array that another made too.
        """
        labels: dict[str, Any] = {}
        arrays: dict[str, AnyArray] = {}
        for name, annotator in self._annotators.items():
            own = annotator.annotate(self._scene, frame, view)
            if self._registry.is_core("annotator", name):
                labels.update(own.values)
            elif own.values:
                labels[name] = own.values
            for array_name, array in own.arrays.items():
                if array_name in arrays:
                    raise ComponentError(f"two annotators make the array {array_name!r}; choose one")
                arrays[array_name] = _full_size(array, view, self._scene.camera)
        try:
            line = LabelLine(
                index=frame.index,
                t_s=frame.t_s,
                epoch_utc=self._epoch.shifted(frame.t_s).iso(),
                sequence=frame.sequence,
                spacecraft=self._scene.spacecraft.name,
                sun_fraction_target=frame.sun_fraction_target,
                sun_fraction_camera=frame.sun_fraction_camera,
                solar_flux_w_m2=frame.solar_flux_w_m2,
                **labels,
            )
        except ValidationError as error:
            raise ComponentError(f"a label cannot be written: {first_fault(error)}") from None
        return line, arrays

    def expose(self, frame: FrameState) -> tuple[AnyArray, float]:
        """The image, (H, W) or (H, W, 3) RGB, uint8 or uint16, and its exposure in seconds."""
        config, light = self._sensor_config, None
        exposure_s = config.exposure_s
        if config.auto_exposure is not None:
            light = self._light(frame, 0.0)
            exposure_s = self._sensor.metered_s(*light, config.auto_exposure)
        if light is None or config.motion_blur is not None:
            light = self._light(frame, exposure_s)
        return self._sensor.expose(*light, exposure_s, self._seed, frame.index), exposure_s

    def _light(self, frame: FrameState, exposure_s: float) -> tuple[SkyView, Radiance | None]:
        """Sky and craft over an exposure; in one instant, if motion is not to blur."""
        blur = self._sensor_config.motion_blur
        instants = 1 if blur is None else blur.instants
        return (
            self._sky.look(frame, exposure_s, instants),
            self._craft.gather(frame, exposure_s, instants),
        )

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()


def _full_size(array: AnyArray, view: View, camera: Camera) -> AnyArray:
    """Paste an array over the view's box into the whole image: −1 or NaN elsewhere."""
    fill = -1 if np.issubdtype(array.dtype, np.integer) else np.nan
    full = np.full((camera.height_px, camera.width_px, *array.shape[2:]), fill, dtype=array.dtype)
    if not view.box.is_empty:
        full[view.box.slices] = array
    return full


def _png(image: AnyArray) -> bytes:
    colour = cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if image.ndim == 3 else image
    ok, data = cv2.imencode(".png", colour, [cv2.IMWRITE_PNG_COMPRESSION, 3])
    if not ok:
        raise ComponentError("the image could not be coded as PNG")
    return bytes(data)


def _npz(arrays: Mapping[str, AnyArray]) -> bytes:
    """An .npz whose bytes depend on the arrays alone (numpy's own carries no date either, but packs
    slower)."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, member.getvalue())
    return buffer.getvalue()
