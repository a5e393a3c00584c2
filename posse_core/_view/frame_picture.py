"""One frame as a picture: the image with its labels drawn, sensors beside it, and a caption below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from posse_core._arrays import AnyArray, FloatArray
from posse_core._dataset.remarks import dark_share, remark_on, saturated_share
from posse_core._dataset.sensors import SensorInfo
from posse_core._detection.draw import Colour, Pen
from posse_core._model.craft_state import BodyState, CraftState
from posse_core._model.label_line import BodyLabels
from posse_core._model.scene import Scene
from posse_core._model.spacecraft import Spacecraft
from posse_core._simulator.frame import Frame
from posse_core._view.coding import eight_bits

LABELS = ("box", "mask", "keypoints", "pose")
"""Annotators whose labels are drawn."""
LEAST_SIDE_PX = 960
"""A smaller image is enlarged by a whole number until its longer side has at least these pixels."""
WHOLE_BOX: Colour = (150, 150, 150)
VISIBLE_BOX: Colour = (80, 220, 80)
MASK: Colour = (255, 220, 60)
BESIDE: Sequence[Colour] = ((199, 146, 255), (255, 159, 107), (80, 200, 255))
"""Of the visible boxes, the outlines of masks and the names of bodies beside the target, in turn."""
KEYPOINT: Colour = (255, 80, 220)
SUN: Colour = (255, 170, 0)
AXES: Mapping[str, Colour] = {"x": (255, 70, 70), "y": (70, 255, 70), "z": (90, 140, 255)}
"""Colours, red-green-blue."""
_TEXT: Colour = (235, 235, 235)
_LEGEND = (
    "box: visible green, whole grey",
    "mask yellow",
    "keypoints: visible dot, hidden ring",
    "body axes x, y, z",
    "arrow to the Sun",
)


def enlargement(height_px: int, width_px: int) -> int:
    """By how much an image is enlarged; the position u of the image is drawn at k u + (k − 1)/2."""
    return max(1, -(-LEAST_SIDE_PX // max(height_px, width_px)))


def arrows_body_m(body: BodyState, spacecraft: Spacecraft) -> dict[str, FloatArray]:
    """Name → tip (3,) of the arrows from a body's origin, m, body axes: the body axes, half as long as
    the spacecraft, and for the target the direction to the Sun, longer by a half.

    All are shorter near the camera, so that none reaches behind it.
    """
    low, high = spacecraft.bounds_body_m
    length_m = min(float((high - low).max()) / 2, body.range_m / 2)
    axes = dict(zip(AXES, length_m * np.eye(3), strict=True))
    if isinstance(body, CraftState):
        axes["Sun"] = 1.5 * length_m * body.sun_direction_body
    return axes


def frame_picture(
    frame: Frame,
    scene: Scene,
    sensors: Mapping[str, SensorInfo],
    *,
    rendered_by: str,
    auto_exposure: bool,
) -> AnyArray:
    """The picture of a frame, (H, W, 3) red-green-blue, uint8.

    Args:
        frame: with the labels of :data:`LABELS`.
        scene: that it shows.
        sensors: beside the camera, by name. Of each, the latest image of the frame is shown; one without
            is named.
        rendered_by: words that name the renderer.
        auto_exposure: the exposure was chosen by the image sensor.
    """
    drawn = _drawn(frame, scene)
    images = {
        name: [reading.image for reading in readings if reading.image is not None]
        for name, readings in frame.readings.items()
    }
    shown = {name: each[-1] for name, each in images.items() if each}
    others = [
        f"{name} ({info.type}, {_counted(len(frame.readings.get(name, ())), 'reading')})"
        for name, info in sensors.items()
        if name not in shown
    ]
    rows = [
        *facts(frame, rendered_by, auto_exposure=auto_exposure),
        _LEGEND,
        *([("without an image:", *others)] if others else []),
    ]
    if shown:
        drawn = np.hstack([drawn, _column(shown, sensors, drawn.shape[0], drawn.shape[1] // 3)])
    return np.vstack([drawn, _caption(rows, drawn.shape[1])])


def _drawn(frame: Frame, scene: Scene) -> AnyArray:
    """The image with the labels of every body and the arrow to the Sun."""
    k = enlargement(*frame.image.shape[:2])
    canvas = _enlarged(_coloured(frame.image), k)
    bodies = zip(frame.labels.instances.items(), scene.bodies, frame.state.craft.bodies, strict=True)
    for number, ((name, labels), spacecraft, body) in enumerate(bodies):
        beside = None if name is None else BESIDE[(number - 1) % len(BESIDE)]
        _draw_outlines(canvas, k, labels, name, beside)
        pen = Pen(canvas)
        start_px = k * frame.camera.project(body.t_body_cam_m) + (k - 1) / 2
        for arrow, tip_body_m in arrows_body_m(body, spacecraft).items():
            tip_cam_m = body.R_cam_from_body @ tip_body_m + body.t_body_cam_m
            end_px = k * frame.camera.project(tip_cam_m) + (k - 1) / 2
            pen.arrow(start_px, end_px, AXES.get(arrow, SUN), arrow)
        for keypoint in labels.keypoints.values():
            if keypoint.visibility and keypoint.u_px is not None and keypoint.v_px is not None:
                at_px = k * np.array([keypoint.u_px, keypoint.v_px]) + (k - 1) / 2
                pen.point(at_px, KEYPOINT, hidden=keypoint.visibility == 1)
    return canvas


def _draw_outlines(
    canvas: AnyArray, k: int, labels: BodyLabels, name: str | None, beside: Colour | None
) -> None:
    """Draw the mask and the boxes of a body into an enlarged image; ``beside`` is the colour of one
    beside the target."""
    pen = Pen(canvas)
    outline = _enlarged(labels.mask_rle.mask().astype(np.uint8), k)
    contours, _ = cv2.findContours(outline, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(canvas, contours, -1, beside or MASK, 1)
    # The whole box is of positions; the visible one counts whole pixels from its first.
    for box, colour, first in (
        (labels.box_whole_px, WHOLE_BOX, (k - 1) / 2),
        (labels.box_visible_px, beside or VISIBLE_BOX, 0),
    ):
        if box is not None:
            pen.box(k * np.array(box, dtype=np.float64) + [first, first, 0, 0], colour)
    if name is not None and beside is not None and labels.box_visible_px is not None:
        x, y = k * np.array(labels.box_visible_px[:2])
        pen.words(name, (round(x), max(round(y) - 2 * pen.line_px, round(25 * pen.font))), beside)


def facts(frame: Frame, rendered_by: str, *, auto_exposure: bool) -> list[Sequence[str]]:
    """What the caption says of a frame, row by row in pieces, in ASCII letters. Pixels and remark are
    those of the target."""
    labels = frame.labels
    craft = frame.image[labels.mask_rle.mask()]
    free = min(labels.sun_fraction_target, labels.sun_fraction_camera)
    remark = remark_on(labels, frame.image)
    exposure = f"exposure {1e3 * frame.exposure_s:.4g} ms"
    return [
        (
            f"{labels.spacecraft}, frame {frame.index}",
            f"{labels.epoch_utc} UTC",
            f"t = {labels.t_s:.10g} s",
        ),
        (
            f"range {labels.range_m:.4g} m",
            f"phase angle {np.degrees(labels.phase_angle_rad):.1f} deg",
            "no eclipse" if free == 1 else f"eclipse: {100 * free:.3g} % of the Sun's disc visible",
        ),
        (
            f"{exposure}, chosen by auto exposure" if auto_exposure else exposure,
            f"spacecraft: {_counted(len(craft), 'pixel')}"
            + (
                f", {100 * saturated_share(craft):.1f} % saturated, {100 * dark_share(craft):.1f} % dark"
                if len(craft)
                else ""
            ),
            "remark: " + (remark.value if remark else "none"),
        ),
        *_joints(labels, frame.state.craft),
        *(
            (
                f"{name} ({body.spacecraft})",
                f"range {body.range_m:.4g} m",
                _counted(body.mask_area_px, "pixel"),
                *(piece for row in _joints(body, state) for piece in row),
            )
            for (name, body), state in zip(
                labels.instances.items(), frame.state.craft.bodies, strict=True
            )
            if name is not None
        ),
        (f"image {frame.camera.width_px} x {frame.camera.height_px} px", rendered_by),
    ]


def _joints(labels: BodyLabels, body: BodyState) -> list[Sequence[str]]:
    """The values of a body's joints that move; nothing if none does."""
    words = [
        f"joint {joint.name} {labels.joints[joint.name].value:.4g} m"
        if joint.kind == "prismatic"
        else f"joint {joint.name} {np.degrees(labels.joints[joint.name].value):.2f} deg"
        for joint in body.articulation.joints
    ]
    return [words] if words else []


def _counted(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def _column(
    images: Mapping[str, AnyArray], sensors: Mapping[str, SensorInfo], height_px: int, width_px: int
) -> AnyArray:
    """Small pictures of the sensors' images, one below another, each with its name."""
    column = np.zeros((height_px, width_px, 3), dtype=np.uint8)
    room_px = height_px // len(images)
    for number, (name, image) in enumerate(images.items()):
        tile = column[number * room_px : (number + 1) * room_px]
        scale = min(width_px / image.shape[1], room_px / image.shape[0])
        size = (max(1, int(scale * image.shape[1])), max(1, int(scale * image.shape[0])))
        small = cv2.resize(_coloured(_stretched(image)), size, interpolation=cv2.INTER_AREA)
        tile[: size[1], : size[0]] = small
        Pen(tile).words(f"{name} ({sensors[name].type})", (4, 14), _TEXT)
    return column


def _stretched(image: AnyArray) -> AnyArray:
    """An image of 16 bits from its least to its greatest value: a scene fills a small part of them."""
    if image.dtype != np.uint16:
        return image
    low, high = int(image.min()), int(image.max())
    return np.round(255 * ((image - low) / max(high - low, 1))).astype(np.uint8)


def _caption(rows: Sequence[Sequence[str]], width_px: int) -> AnyArray:
    """Rows of words; a row that is too long goes on in the next, at the end of a piece."""
    font, margin_px = max(0.4, width_px / 2000), max(6, width_px // 160)

    def width_of(text: str) -> int:
        return int(cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, font, 1)[0][0])

    lines: list[str] = []
    for pieces in rows:
        lines.append(pieces[0])
        for piece in pieces[1:]:
            longer = f"{lines[-1]}   {piece}"
            if width_of(longer) <= width_px - 2 * margin_px:
                lines[-1] = longer
            else:
                lines.append(piece)
    step_px = round(40 * font)
    strip = np.zeros((step_px * len(lines) + 2 * margin_px, width_px, 3), dtype=np.uint8)
    for number, line in enumerate(lines):
        at_px = (margin_px, margin_px + round((number + 0.7) * step_px))
        cv2.putText(strip, line, at_px, cv2.FONT_HERSHEY_SIMPLEX, font, _TEXT, 1, cv2.LINE_AA)
    return strip


def _coloured(image: AnyArray) -> AnyArray:
    small = eight_bits(image)
    return small.copy() if small.ndim == 3 else np.repeat(small[:, :, None], 3, axis=2)


def _enlarged(image: AnyArray, k: int) -> AnyArray:
    """Each pixel as a square of k × k."""
    return np.ascontiguousarray(image.repeat(k, axis=0).repeat(k, axis=1))
