"""Checks of what components return, so that a fault is named where it was made.

A component may be anybody's code. Each check raises a :class:`posse_core.ComponentError`, one line that
names the component and says what is wrong. A propagator's motion is checked by
:mod:`posse_core._trajectory.returned`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np

from posse_core._arrays import AnyArray, Float32Array
from posse_core._dataset.dataset import Dataset
from posse_core._dataset.layout import MANIFEST, inside
from posse_core._errors import ComponentError
from posse_core._files.atomic import atomic_folder
from posse_core._interfaces.renderer import Renderer
from posse_core._interfaces.scene import SceneSource
from posse_core._interfaces.writer import Writer
from posse_core._model.camera import Camera
from posse_core._model.labels import Labels, View
from posse_core._model.reading import Reading
from posse_core._model.scene import Radiance, RenderRequest, Scene
from posse_core._model.spacecraft import Material, Part, Spacecraft
from posse_core._plugins.component import failures_named
from posse_core._simulator.returned_joints import check_joints
from posse_core._simulator.returned_types import check, floats, of_type, type_of

FILL: Final[Mapping[str, float | int | bool]] = {"f": np.nan, "i": -1, "u": 0, "b": False}
"""Kind of an annotator's array (``dtype.kind``) → its value where the view's box does not reach."""

_FILE_NAME = re.compile(r"\w[\w.-]*")
_ENDING = re.compile(r"\.[a-z0-9]+")
_LARGEST: Final = float(np.finfo(np.float32).max)
_ROUNDING: Final = 1e-4
"""How far coverage may be outside of 0 … 1."""


class CheckedRenderer(Renderer):
    """A renderer whose radiance is checked."""

    def __init__(self, renderer: Renderer, name: str) -> None:
        super().__init__(renderer.options)
        self._renderer = renderer
        self._name = name

    def open(self, scene: Scene) -> None:
        self._renderer.open(scene)

    def render(self, request: RenderRequest) -> Radiance:
        with failures_named("renderer", self._name):
            made = self._renderer.render(request)
        return checked_radiance(made, request, self._name)

    def close(self) -> None:
        self._renderer.close()

    def describe(self) -> dict[str, str]:
        """See :meth:`posse_core.Renderer.describe`."""
        said = self._renderer.describe()
        if not isinstance(said, Mapping) or not all(
            isinstance(key, str) and isinstance(value, str) for key, value in said.items()
        ):
            raise ComponentError(f"renderer {self._name!r}: describe() must give strings by string")
        return dict(said)


def checked_radiance(made: object, request: RenderRequest, name: str) -> Radiance:
    """What a renderer returned for a request: of its box, float32, finite and not negative."""
    light = of_type(made, Radiance, f"renderer {name!r}")
    box = request.box
    if light.box != box:
        raise ComponentError(f"renderer {name!r} returned the box {light.box}, and was asked for {box}")
    shape = (box.height, box.width)
    check(light.radiance_rgb, (*shape, 3), "float32", f"renderer {name!r}: radiance_rgb", finite=False)
    check(light.coverage, shape, "float32", f"renderer {name!r}: coverage", finite=False)
    if light.depth_m is not None:
        check(light.depth_m, shape, "float32", f"renderer {name!r}: depth_m", finite=False)
    for array, low, high, words in (
        (light.radiance_rgb, 0.0, _LARGEST, "radiance_rgb has numbers that are negative or not finite"),
        (light.coverage, -_ROUNDING, 1 + _ROUNDING, "coverage has numbers outside of 0 … 1"),
    ):
        if not _within(array, low, high):
            raise ComponentError(f"renderer {name!r}: {words}")
    return light


def checked_labels(made: object, name: str, view: View) -> Labels:
    """What an annotator returned for a view, its values as plain JSON types.

    NumPy's numbers and arrays, and tuples, become numbers and lists.
    """
    labels = of_type(made, Labels, f"annotator {name!r}")
    who = f"annotator {name!r}"
    if not isinstance(labels.values, Mapping) or not isinstance(labels.arrays, Mapping):
        raise ComponentError(f"{who}: values and arrays of its Labels must be mappings")
    for key, array in labels.arrays.items():
        if not isinstance(key, str) or not _FILE_NAME.fullmatch(key):
            raise ComponentError(f"{who}: {key!r} cannot be an array's name; take letters, digits and _")
        _check_over_box(array, view, f"{who}: the array {key!r}")
    return Labels(_plain(labels.values, who, ""), labels.arrays)


def checked_reading(made: object, name: str, camera: Camera | None) -> Reading:
    """What a sensor returned, its labels as plain JSON types; ``camera`` is the sensor's."""
    who = f"sensor {name!r}"
    reading = of_type(made, Reading, who)
    for what in ("labels", "arrays", "files"):
        if not isinstance(getattr(reading, what), Mapping):
            raise ComponentError(f"{who}: {what} of its Reading must be a mapping")
    for key, array in reading.arrays.items():
        if not isinstance(key, str) or not _FILE_NAME.fullmatch(key):
            raise ComponentError(f"{who}: {key!r} cannot be an array's name; take letters, digits and _")
        if not isinstance(array, np.ndarray) or array.dtype.kind not in FILL:
            raise ComponentError(
                f"{who}: the array {key!r} must be a NumPy array of floats, integers or booleans"
            )
    for ending, content in reading.files.items():
        if not isinstance(ending, str) or not _ENDING.fullmatch(ending):
            raise ComponentError(f"{who}: {ending!r} cannot end a file's name; give one such as '.ply'")
        if ending in (".png", ".npz"):
            raise ComponentError(f"{who}: {ending} files are for image and arrays of its Reading")
        if not isinstance(content, bytes):
            raise ComponentError(f"{who}: the file {ending!r} is {type_of(content)}, not bytes")
    image = reading.image
    if image is not None:
        kinds = isinstance(image, np.ndarray) and image.dtype in (np.uint8, np.uint16)
        if not kinds or image.shape[2:] not in ((), (3,)) or image.ndim < 2 or not image.size:
            raise ComponentError(f"{who}: the image must be (H, W) or (H, W, 3) of uint8 or uint16")
        if camera is not None and image.shape[:2] != (camera.height_px, camera.width_px):
            raise ComponentError(f"{who}: the image is {image.shape[:2]}, not of its camera's size")
    return replace(reading, labels=_plain(reading.labels, who, ""))


def full_size(array: AnyArray, view: View, camera: Camera) -> AnyArray:
    """(H, W, ...) an annotator's array over the view's box in the whole image; see :data:`FILL`."""
    shape = (camera.height_px, camera.width_px, *array.shape[2:])
    full = np.full(shape, FILL[array.dtype.kind], dtype=array.dtype)
    if not view.box.is_empty:
        full[view.box.slices] = array
    return full


def built(source: SceneSource, name: str) -> Spacecraft:
    """The spacecraft that a scene source builds, checked."""
    with failures_named("scene", name):
        made = source.build()
    return checked_spacecraft(made, name)


def checked_spacecraft(made: object, name: str) -> Spacecraft:
    """What a scene source built: arrays of the right shapes, whose indices and names exist."""
    who = f"scene {name!r}"
    craft = of_type(made, Spacecraft, who)
    if not isinstance(craft.name, str) or not _FILE_NAME.fullmatch(craft.name):
        raise ComponentError(
            f"{who}: the name {craft.name!r} cannot be a file's; take letters, digits, _"
        )
    if not craft.parts:
        raise ComponentError(f"{who}: the spacecraft has no parts")
    names = [_checked_part(part, craft, who).name for part in craft.parts]
    if len(set(names)) < len(names):
        raise ComponentError(f"{who}: two parts have one name ({', '.join(sorted(names))})")
    for key, material in craft.materials.items():
        _check_textures(of_type(material, Material, f"{who}: the material {key!r}"), f"{who}: {key!r}")
    for key, point in craft.keypoints_body_m.items():
        floats(point, (3,), f"{who}: the keypoint {key!r}")
    for pair in craft.skeleton:
        unknown = [key for key in pair if key not in craft.keypoints_body_m]
        if unknown or len(pair) != 2:
            raise ComponentError(f"{who}: the skeleton has {tuple(pair)!r}, not two of its keypoints")
    for R in craft.symmetries:
        floats(R, (3, 3), f"{who}: a symmetry")
    check_joints(craft, who)
    return craft


def checked_paths(made: object, name: str, folder: Path) -> list[Path]:
    """What a writer returned: files and folders that exist, all within ``folder``."""
    who = f"writer {name!r}"
    if not isinstance(made, Iterable) or isinstance(made, str | bytes):
        raise ComponentError(f"{who} returned {type_of(made)}, and must return paths")
    paths = []
    home = folder.resolve()
    for path in made:
        if not isinstance(path, Path):
            raise ComponentError(f"{who} returned {path!r} among its paths; it must be a pathlib.Path")
        if not path.resolve().is_relative_to(home):
            raise ComponentError(f"{who} returned {path}, which is not within {folder}")
        if not path.exists():
            raise ComponentError(f"{who} returned {path}, which it has not written")
        paths.append(path)
    return paths


def written(writer: Writer, name: str, dataset: Dataset, folder: Path) -> list[Path]:
    """Export a dataset, and check the paths that the writer returns.

    The writer works in a folder of its own, whose files move to ``folder`` when it has ended: an export
    is there as a whole or not at all. Of an earlier export into the dataset's own folder, the files that
    are not written again are removed, such as an image that is in another part now.
    """
    with atomic_folder(folder) as building:
        with failures_named("writer", name):
            made = writer.write(dataset, building)
        paths = [path.relative_to(building) for path in checked_paths(made, name, building)]
        files = {path.relative_to(building).as_posix() for path in building.rglob("*")}
    if (folder / MANIFEST).exists() and folder.resolve() == dataset.folder.resolve():
        for old in dataset.manifest.exports.keys() - files:
            if any(Path(old).is_relative_to(path) for path in paths):
                inside(folder, old).unlink(missing_ok=True)
    return [folder / path for path in paths]


def _checked_part(part: object, craft: Spacecraft, who: str) -> Part:
    mesh = of_type(part, Part, f"{who}: a part")
    at = f"{who}: {mesh.name!r}"
    check(mesh.vertices_body_m, (None, 3), "floating", f"{at}: vertices_body_m")
    check(mesh.faces, (None, 3), "integer", f"{at}: faces")
    count = len(mesh.vertices_body_m)
    check(mesh.normals_body, (count, 3), "floating", f"{at}: normals_body")
    check(mesh.uv, (count, 2), "floating", f"{at}: uv")
    if not len(mesh.faces) or mesh.faces.min() < 0 or mesh.faces.max() >= count:
        raise ComponentError(f"{at}: has no faces, or faces of other than its {count} vertices")
    if mesh.material not in craft.materials:
        raise ComponentError(f"{at}: there is no material {mesh.material!r}")
    return mesh


def _check_textures(material: Material, at: str) -> None:
    for key, channels in (
        ("base_color_texture", 3),
        ("metallic_roughness_texture", 2),
        ("normal_texture", 3),
    ):
        texture = getattr(material, key)
        if texture is not None:
            check(texture, (None, None, channels), "uint8", f"{at}: {key}")


def _check_over_box(array: object, view: View, what: str) -> None:
    box = view.part_id.shape
    if not isinstance(array, np.ndarray):
        raise ComponentError(f"{what} is {type_of(array)}, and must be a NumPy array")
    found = f"{array.dtype} of shape {array.shape}"
    if array.shape[:2] != box:
        raise ComponentError(f"{what} is {found}; its first two sides must be the view's box, {box}")
    if array.dtype.kind not in FILL:
        raise ComponentError(f"{what} is {found}; it must be of floats, integers or booleans")


def _plain(value: object, who: str, key: str) -> Any:
    """A label's value as JSON has it."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return str.__str__(value)
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        if not isfinite(value):
            raise ComponentError(f"{who}: the label {key!r} is {value}; give None for no value")
        return float(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in FILL:
        return _plain(value.tolist(), who, key)
    if isinstance(value, list | tuple):
        return [_plain(item, who, f"{key}.{i}") for i, item in enumerate(value)]
    if isinstance(value, Mapping):
        wrong = next((name for name in value if not isinstance(name, str)), None)
        if wrong is not None:
            raise ComponentError(f"{who}: {wrong!r} cannot be a label's key; keys are strings")
        before = f"{key}." if key else ""
        return {name: _plain(item, who, before + name) for name, item in value.items()}
    raise ComponentError(
        f"{who}: the label {key!r} is {type_of(value)}, which JSON does not have; give numbers,"
        " strings, booleans, None, or lists and mappings of them"
    )


def _within(array: Float32Array, low: float, high: float) -> bool:
    """Whether all numbers are within ``low`` … ``high``, where ``low`` is at most 0; NaN is not.

    A picture may be a million pixels, so what is usual takes one pass over them: the bits of floats from
    +0 on, read as unsigned integers, are in the order of the numbers, and below the bits of infinity, of
    NaN, and of all that have a minus sign.
    """
    bits = array.view(array.dtype.str.replace("f", "u"))
    if bits.max() <= np.float32(high).view(np.uint32):
        return True
    return bool(array.min() >= low and array.max() <= high)
