"""Reading a camera's calibration from the files of calibration programs.

These are OpenCV's ``cv2.FileStorage`` (YAML, XML, JSON), ROS's ``camera_info``, Kalibr's camera chain,
COLMAP's ``cameras.txt``, and the ``camera.json`` of SPEED+ and of POSSE's datasets. A file's kind is
told from its content, which is parsed by what is safe for files of unknown origin.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from posse_core._errors import InputError
from posse_core._files.reading import parsed_json, read_text
from posse_core._model.camera import MOST_SIDE_PX
from posse_core._model.distortion import DistortionModel, distortion_of
from posse_core._scenario.yaml_lines import YamlText

_MODELS: Final[Mapping[str, DistortionModel]] = {
    **dict.fromkeys(("plumb_bob", "rational_polynomial", "radtan", "brown-conrady"), "brown-conrady"),
    **dict.fromkeys(("equidistant", "equi", "fisheye"), "fisheye"),
}
"""Distortion models by the names that ROS, Kalibr and POSSE give them."""
_COLMAP: Final[Mapping[str, tuple[int, DistortionModel, tuple[int, ...]]]] = {
    "SIMPLE_PINHOLE": (1, "brown-conrady", ()),
    "PINHOLE": (2, "brown-conrady", ()),
    "SIMPLE_RADIAL": (1, "brown-conrady", (0,)),
    "RADIAL": (1, "brown-conrady", (0, 1)),
    "OPENCV": (2, "brown-conrady", (0, 1, 2, 3)),
    "FULL_OPENCV": (2, "brown-conrady", (0, 1, 2, 3, 4, 5, 6, 7)),
    "SIMPLE_RADIAL_FISHEYE": (1, "fisheye", (0,)),
    "RADIAL_FISHEYE": (1, "fisheye", (0, 1)),
    "OPENCV_FISHEYE": (2, "fisheye", (0, 1, 2, 3)),
}
"""COLMAP's models: the number of focal lengths, and the place in OpenCV's order of each coefficient."""
_COLMAP_CENTRE = 0.5
"""Position of the centre of COLMAP's first pixel."""
_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "k")
_COEFFICIENTS = (
    "distortion_coefficients",
    "distCoeffs",
    "Distortion_Coefficients",
    "dist_coeffs",
    "D",
    "d",
)
_SIZES = (
    ("image_width", "image_height"),
    ("image_Width", "image_Height"),
    ("width", "height"),
    ("Nu", "Nv"),
)
_SIZE_LISTS = ("cameraResolution", "image_size", "imageSize")
_LARGEST = 1e12
_MOST_NUMBERS = 100


@dataclass(frozen=True)
class Calibration:
    """The intrinsics that a file gives; what it does not tell is None.

    Attributes:
        name: of the file, for messages.
        focal_px: along x and y.
        centre_px: principal point, with the centre of the first pixel at (0, 0).
        coefficients: of the lens, in OpenCV's order; none for a pinhole.
        model: of the lens.
        size_px: width and height of the image.
        sensor_width_m: width of the image sensor.
        line_time_s: time from the exposure of one row to that of the next.
    """

    name: str
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    coefficients: tuple[float, ...]
    model: DistortionModel | None
    size_px: tuple[int, int] | None = None
    sensor_width_m: float | None = None
    line_time_s: float | None = None

    def keys(self, model: DistortionModel | None, with_lens: bool) -> dict[str, Any]:
        """Keys of a scenario's ``camera``.

        Args:
            model: of the lens, if the scenario gives it.
            with_lens: whether those of the lens are wanted.

        Raises:
            InputError: the coefficients are not those of the model, or fit two.
        """
        keys: dict[str, Any] = {"focal_px": self.focal_px, "centre_px": self.centre_px}
        if self.size_px is not None:
            keys["width_px"], keys["height_px"] = self.size_px
        if self.sensor_width_m is not None:
            keys["sensor_width_mm"] = self.sensor_width_m * 1e3
        if self.line_time_s is not None:
            keys["line_time_s"] = self.line_time_s
        if not with_lens:
            return keys
        model = model or self.model
        if model is None and len(self.coefficients) == 4:
            raise InputError(
                f"{self.name}: four coefficients are those of two models; add distortion_model:"
                " brown-conrady or fisheye beside calibration, or fisheye_model: 0 or 1 to the file"
            )
        try:
            lens = distortion_of(model or "brown-conrady", self.coefficients)
        except ValueError as error:
            raise InputError(f"{self.name}: distortion: {error}") from None
        if lens is not None:
            keys["distortion_model"], keys["distortion"] = lens.model, lens.coefficients.tolist()
        return keys


def read_calibration(source: str) -> Calibration:
    """Read a calibration.

    Args:
        source: the file, or ``FILE#NAME`` for one of several cameras: ``camchain.yaml#cam1`` of
            Kalibr's, ``cameras.txt#2`` of COLMAP's.

    Raises:
        InputError: the file cannot be read, is of another kind, or the camera is not one that POSSE
            models; the message is one line that names the file.
    """
    file, _, chosen = (source, "", "") if Path(source).exists() else source.rpartition("#")
    path = Path(file or source)
    text = read_text(path).lstrip("\ufeff")
    start = next((line for line in text.splitlines() if line.strip() and line[0] != "#"), "").split()
    if len(start) > 1 and start[0].isdecimal() and re.fullmatch("[A-Z_]+", start[1]):
        return _colmap(text, str(path), chosen)
    if text.lstrip().startswith("<"):
        value = _xml(text, str(path))
    elif text.lstrip().startswith("{"):
        value = parsed_json(text, str(path))
    else:
        value = YamlText(_plain_yaml(text), str(path)).value
    if not isinstance(value, dict):
        raise _unknown(path)
    cameras = {key: inner for key, inner in value.items() if _is_kalibr(inner)}
    if cameras or _is_kalibr(value):
        return _kalibr(_chosen(cameras or {"": value}, chosen, str(path)), str(path))
    return _opencv(_chosen({"": value}, chosen, str(path)), str(path))


def _plain_yaml(text: str) -> str:
    """OpenCV's YAML without its directive and its tags, and ROS's without the mark after a message."""
    text = re.sub(r"\A%YAML[^\n]*", "", text)
    return re.sub(r"!!opencv-[a-z-]+", "", text).rstrip().removesuffix("\n---")


def _xml(text: str, name: str) -> dict[str, Any]:
    """The values of OpenCV's XML."""
    if "<!" in re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL):
        raise InputError(f"{name}: not a calibration: XML with a document type; leave it out")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{name}: not XML: {error}") from None
    return {node.tag: _xml_value(node) for node in root}


def _xml_value(node: ElementTree.Element) -> Any:
    data = node.find("data")
    words = (node.text if data is None else data.text or "") or ""
    try:
        numbers = [float(word) for word in words.split()]
    except ValueError:
        return words.strip().strip('"')
    return numbers[0] if len(numbers) == 1 and data is None else numbers


def _is_kalibr(value: Any) -> bool:
    return isinstance(value, dict) and "intrinsics" in value and "camera_model" in value


def _chosen(cameras: Mapping[Any, Any], chosen: str, name: str) -> Any:
    """The camera of a name, or the only one."""
    if chosen in map(str, cameras) and chosen:
        return next(camera for key, camera in cameras.items() if str(key) == chosen)
    names = ", ".join(map(str, cameras))
    if chosen:
        raise InputError(f"{name}: has no camera {chosen!r}{f' but {names}' if names else ''}")
    if len(cameras) > 1:
        raise InputError(f"{name}: has cameras {names}; name one, as in {name}#{next(iter(cameras))}")
    return next(iter(cameras.values()))


def _kalibr(camera: Mapping[str, Any], name: str) -> Calibration:
    if camera["camera_model"] != "pinhole":
        raise InputError(
            f"{name}: camera_model is {str(camera['camera_model'])[:40]!r}, and only 'pinhole' can be"
            " read; calibrate with pinhole-radtan or pinhole-equi"
        )
    fu, fv, pu, pv = _numbers(camera["intrinsics"], f"{name}: intrinsics", 4)
    told = camera.get("distortion_model", "none")
    return Calibration(
        name,
        _positive((fu, fv), f"{name}: intrinsics"),
        (pu, pv),
        ()
        if told == "none"
        else _numbers(camera.get("distortion_coeffs"), f"{name}: distortion_coeffs"),
        None if told == "none" else _model(told, name),
        _size(camera["resolution"], f"{name}: resolution") if "resolution" in camera else None,
    )


def _opencv(value: Mapping[str, Any], name: str) -> Calibration:
    """The camera of OpenCV's files, of ROS's, which have the same keys or their initials, and of
    ``camera.json``."""
    matrix = next((key for key in _MATRIX if key in value), None)
    if matrix is None:
        raise _unknown(Path(name))
    fx, skew, cx, below, fy, cy, *last = _numbers(value[matrix], f"{name}: {matrix}", 9)
    if below != 0 or last != [0, 0, 1]:
        raise InputError(
            f"{name}: {matrix}: is not a camera matrix, whose last rows are 0 f c and 0 0 1"
        )
    if abs(skew) > 1e-9 * abs(fx):
        raise InputError(f"{name}: {matrix}: has a skew of {skew:g}, which is not modelled; use 0")
    lens = next((key for key in _COEFFICIENTS if key in value), None)
    pitch_m, line_time_s = value.get("ppx"), value.get("lineTime_s")
    size_px = _size_of(value, name)
    return Calibration(
        name,
        _positive((fx, fy), f"{name}: {matrix}"),
        (cx, cy),
        () if lens is None else _numbers(value[lens], f"{name}: {lens}"),
        _told_model(value, name),
        size_px,
        None
        if pitch_m is None or size_px is None
        else size_px[0] * _positive(_numbers([pitch_m], f"{name}: ppx", 1), f"{name}: ppx")[0],
        None if line_time_s is None else _numbers([line_time_s], f"{name}: lineTime_s", 1)[0],
    )


def _told_model(value: Mapping[str, Any], name: str) -> DistortionModel | None:
    """The distortion model that a file of OpenCV's kind tells."""
    for key in ("distModel", "distortion_model"):
        if value.get(key):
            return _model(value[key], name)
    if "fisheye_model" in value:  # of OpenCV's calibration program
        return "fisheye" if value["fisheye_model"] else "brown-conrady"
    return "brown-conrady" if "Nu" in value else None  # SPEED+'s camera.json


def _size_of(value: Mapping[str, Any], name: str) -> tuple[int, int] | None:
    for keys in _SIZES:
        if all(key in value for key in keys):
            return _size([value[key] for key in keys], f"{name}: {', '.join(keys)}")
    return next((_size(value[key], f"{name}: {key}") for key in _SIZE_LISTS if key in value), None)


def _colmap(text: str, name: str, chosen: str) -> Calibration:
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    words = _chosen({words[0]: words for words in lines}, chosen, name)
    known = _COLMAP.get(words[1] if len(words) > 1 else "")
    if known is None:
        raise InputError(
            f"{name}: camera {words[0][:20]} is of no known model; known ones are {', '.join(_COLMAP)}"
        )
    focal_lengths, model, places = known
    numbers = _numbers(words[2:], f"{name}: camera {words[0]}", 4 + focal_lengths + len(places))
    focal_px, lens = numbers[2 : 2 + focal_lengths], numbers[4 + focal_lengths :]
    cx, cy = numbers[2 + focal_lengths : 4 + focal_lengths]
    coefficients = [0.0] * max(4, len(places))
    for place, coefficient in zip(places, lens, strict=True):
        coefficients[place] = coefficient
    return Calibration(
        name,
        _positive((focal_px[0], focal_px[-1]), f"{name}: camera {words[0]}"),
        (cx - _COLMAP_CENTRE, cy - _COLMAP_CENTRE),
        tuple(coefficients) if places else (),
        model,
        _size(numbers[:2], f"{name}: camera {words[0]}"),
    )


def _model(told: object, name: str) -> DistortionModel:
    model = _MODELS.get(str(told))
    if model is None:
        raise InputError(
            f"{name}: distortion model {str(told)[:40]!r} cannot be read; those that can are"
            f" {', '.join(_MODELS)}"
        )
    return model


def _numbers(value: Any, what: str, count: int | None = None) -> tuple[float, ...]:
    """The numbers of a list, a list of lists, or a matrix with ``data``.

    Raises:
        InputError: something is no number, or their count is another.
    """
    if isinstance(value, Mapping):
        value = value.get("data")
    words = [] if value is None else list(_flat(value, 0))
    try:
        numbers = tuple(float(word) for word in words if not isinstance(word, bool))
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what}: has something that is no number") from None
    if not all(math.isfinite(number) and abs(number) < _LARGEST for number in numbers):
        raise InputError(f"{what}: has a number that is not finite, or is {_LARGEST:g} or larger")
    if len(numbers) != len(words) or (count is not None and len(numbers) != count):
        raise InputError(f"{what}: has {len(numbers)} numbers instead of {count or len(words)}")
    return numbers


def _flat(value: Any, depth: int) -> Iterable[Any]:
    if not isinstance(value, list) or depth > 2:
        return [value]
    if len(value) > _MOST_NUMBERS:
        return value[: _MOST_NUMBERS + 1]
    return [number for inner in value for number in _flat(inner, depth + 1)]


def _positive(numbers: tuple[float, ...], what: str) -> tuple[float, float]:
    if not all(number > 1e-9 for number in numbers):
        raise InputError(f"{what}: a length is not above 0")
    return numbers[0], numbers[-1]


def _size(value: Any, what: str) -> tuple[int, int]:
    width, height = _numbers(list(value) if isinstance(value, tuple) else value, what, 2)
    if not all(side.is_integer() and 1 <= side <= MOST_SIDE_PX for side in (width, height)):
        raise InputError(f"{what}: {width:g} x {height:g} is not a size of 1 to {MOST_SIDE_PX} pixels")
    return int(width), int(height)


def _unknown(path: Path) -> InputError:
    return InputError(
        f"{path}: not a calibration: it has none of camera_matrix, cameraMatrix and K (OpenCV, ROS,"
        " camera.json), no camera_model with intrinsics (Kalibr), and no line of COLMAP's cameras.txt"
    )
