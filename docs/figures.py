"""Draws the figures of axes, relative orbits and data flow: ``python docs/figures.py``, with matplotlib.

The figures are kept in docs/images as SVG, which comes out the same on every machine.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyBboxPatch

from posse_core._arrays import FloatArray
from posse_core._constants import Constants
from posse_core._dynamics.roe import rtn_from_roe

IMAGES = Path(__file__).with_name("images")
RED, GREEN, BLUE, GREY, ORANGE = "#c0392b", "#1e8449", "#1f5fa8", "#707b7c", "#b9770e"
plt.rcParams.update(
    {"svg.hashsalt": "posse", "font.size": 10, "axes.titlesize": 10, "savefig.facecolor": "white"}
)


def arrow(axes: Axes, start: FloatArray, end: FloatArray, colour: str, dashed: bool = False) -> None:
    style = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    if dashed:
        style |= {"ls": "--", "lw": 1.1}
    axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=style)


def plain(axes: Axes, width: tuple[float, float], height: tuple[float, float]) -> None:
    axes.set(xlim=width, ylim=height, aspect="equal")
    axes.axis("off")


def save(figure: Figure, name: str) -> None:
    figure.savefig(IMAGES / f"{name}.svg", metadata={"Date": None}, bbox_inches="tight", pad_inches=0.1)
    plt.close(figure)


def rtn_axes() -> None:
    """The plane of the orbit, seen from the end of N."""
    figure, axes = plt.subplots(figsize=(6.4, 4.4))
    plain(axes, (-1.5, 5.2), (-1.25, 3.9))
    axes.add_patch(Circle((0, 0), 1.0, color="#d6e6f5", ec=BLUE, lw=1.2))
    axes.text(0, 0, "Earth", ha="center", va="center", color=BLUE)
    axes.add_patch(Arc((0, 0), 5.6, 5.6, theta1=-18, theta2=112, color=GREY, lw=1.0, ls="-"))
    axes.text(-0.9, 2.82, "orbit", color=GREY, ha="center")
    angle = np.radians(32)
    radial = np.array([np.cos(angle), np.sin(angle)])
    along = np.array([-np.sin(angle), np.cos(angle)])
    target = 2.8 * radial
    axes.plot([0, target[0]], [0, target[1]], color=GREY, lw=0.8, ls=":")
    arrow(axes, target, target + 1.25 * radial, RED)
    axes.text(*(target + 1.35 * radial), "R, radially outward", color=RED, va="center")
    arrow(axes, target, target + 1.25 * along, GREEN)
    axes.text(*(target + 1.42 * along), "T = N × R = V-bar,\nalong the motion", color=GREEN, ha="center")
    arrow(axes, target, target - 0.85 * radial, ORANGE, dashed=True)
    axes.text(*(target - 0.85 * radial + (-0.12, 0.1)), "R-bar = −R", color=ORANGE, ha="right")
    axes.add_patch(Circle(target, 0.13, fc="white", ec=BLUE, lw=1.5, zorder=4))
    axes.plot(*target, ".", color=BLUE, ms=5, zorder=5)
    axes.text(
        *np.add(target, (0.5, -0.2)),
        "target; N out of the page,\nalong r × v;  H-bar = −N",
        color=BLUE,
        va="top",
    )
    chaser = target + 0.75 * radial + 0.75 * along
    axes.plot(*chaser, "s", color="black", ms=6)
    axes.plot([target[0], chaser[0]], [target[1], chaser[1]], color="black", lw=0.9)
    axes.text(*np.add(chaser, (0.12, 0.05)), "chaser at r_rtn_m", va="center")
    save(figure, "axes-rtn")


def camera_axes() -> None:
    """Camera and body axes in space on the left, and pixels on the right."""
    figure, (space, image) = plt.subplots(1, 2, figsize=(9.6, 4.2), width_ratios=[1.6, 1])
    plain(space, (-1.6, 5.6), (-2.0, 4.0))
    forward = np.array([-0.9, 0.55, 0.6]) / np.linalg.norm([-0.9, 0.55, 0.6])
    right = np.cross(forward, [0.0, -1.0, 0.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)

    def seen(*point: float) -> FloatArray:
        return np.array([right @ point, up @ point])

    origin = seen(0, 0, 0)
    corners = [seen(x, y, 2.2) for x, y in ((-0.9, -0.65), (0.9, -0.65), (0.9, 0.65), (-0.9, 0.65))]
    for corner in corners:
        space.plot([origin[0], corner[0]], [origin[1], corner[1]], color=GREY, lw=0.7)
    space.fill(*np.transpose(corners), fc="#eef3f8", ec=GREY, lw=0.9, alpha=0.9)
    space.plot(*corners[0], "o", color=GREY, ms=4)
    space.annotate(
        "pixel (0, 0)", corners[0], (0, 7), textcoords="offset points", color=GREY, ha="center"
    )
    for name, axis, colour in (
        ("x, right", (1.2, 0, 0), RED),
        ("y, down", (0, 1.2, 0), GREEN),
        ("z, forward", (0, 0, 3.2), BLUE),
    ):
        end = seen(*axis)
        arrow(space, origin, end, colour)
        space.text(
            *(end + 0.2 * end / np.linalg.norm(end)),
            name,
            color=colour,
            ha="left" if colour == BLUE else "center",
            va="center",
        )
    space.text(*np.add(origin, (-0.15, 0.25)), "camera", ha="right")
    body = np.array([-0.7, -1.3, 5.2])
    place = seen(*body)
    arrow(space, origin, place, "black", dashed=True)
    space.text(*np.add(seen(*(0.72 * body)), (-0.1, 0.25)), "t_body_cam_m", ha="right")
    turned = np.linalg.qr(np.array([[0.3, 0.8, 0.4], [-0.9, 0.3, 0.2], [0.1, -0.5, 0.9]]))[0]
    turned *= np.sign(np.linalg.det(turned))
    for name, column, colour in zip("xyz", turned.T, (RED, GREEN, BLUE), strict=True):
        end = seen(*(body + 0.95 * column))
        arrow(space, place, end, colour)
        space.text(*(place + 1.16 * (end - place)), name, color=colour, ha="center", va="center")
    space.text(
        *np.add(place, (0.1, -0.75)),
        "body axes: the mesh's,\norigin at the centre of mass",
        va="top",
    )
    space.text(1.9, -1.95, "x_cam = R_cam_from_body · x_body + t_body_cam_m", ha="center")

    plain(image, (-2.1, 6.0), (5.6, -1.9))
    for column in range(7):
        image.plot([column - 0.5] * 2, [-0.5, 3.5], color="#b8c4ce", lw=0.8)
    for row in range(5):
        image.plot([-0.5, 5.5], [row - 0.5] * 2, color="#b8c4ce", lw=0.8)
    image.plot(0, 0, "o", color="black", ms=4)
    image.text(-0.4, -0.85, "(0, 0): centre of the\ntop-left pixel", va="bottom")
    arrow(image, np.array([0.0, 0.0]), np.array([2.0, 0.0]), RED)
    image.text(2.1, 0.05, "x", color=RED, va="center")
    arrow(image, np.array([0.0, 0.0]), np.array([0.0, 2.0]), GREEN)
    image.text(0.15, 2.1, "y", color=GREEN, va="center")
    image.plot(5, 3, "o", color="black", ms=4)
    image.text(5.5, 4.0, "(width − 1, height − 1)", ha="right", va="center")
    save(figure, "axes-camera")


def relative_orbits() -> None:
    """What each element of roe_m does to the relative orbit of a target in a circular orbit."""
    constants = Constants()
    a, inclination = 7.0e6, np.radians(98.0)
    chief = np.array([a, 0.0, 0.0, 0.0, inclination, 0.0])
    period = 2 * np.pi * np.sqrt(a**3 / constants.mu_earth_m3_s2)

    def orbit(roe_m: list[float], orbits: float = 1.0) -> FloatArray:
        times = np.linspace(0, orbits * period, 361)
        return rtn_from_roe(chief, np.array(roe_m) / a, constants.mu_earth_m3_s2, times)[:, :3]

    figure, (ellipse, drift, tilt) = plt.subplots(1, 3, figsize=(10.8, 3.0), width_ratios=[58, 96, 40])
    r = orbit([0, -30, 0, 10, 0, 0])
    ellipse.plot(r[:, 1], r[:, 0], color=BLUE)
    ellipse.plot(0, 0, "k.", ms=9)
    ellipse.plot(-30, 0, "+", color=GREY)
    arrow(ellipse, np.array([-30.0, 0]), np.array([-30.0, 10]), RED)
    ellipse.text(-29.3, 4.5, "a·|δe|", color=RED)
    arrow(ellipse, np.array([-30.0, 0]), np.array([-50.0, 0]), RED)
    ellipse.text(-46.5, 1.3, "2 a·|δe|", color=RED)
    arrow(ellipse, np.array([0.0, -14]), np.array([-30.0, -14]), GREEN)
    ellipse.text(-15, -13.2, "a·δλ", color=GREEN, ha="center")
    ellipse.set(title="roe_m: [0, −30, 0, 10, 0, 0]", xlabel="T, m", ylabel="R, m")
    ellipse.set(xlim=(-54, 4), ylim=(-19, 19), aspect="equal")

    r = orbit([2, 30, 0, 10, 0, 0], 3)
    drift.plot(r[:, 1], r[:, 0], color=BLUE)
    drift.plot(r[0, 1], r[0, 0], "o", color=BLUE, ms=4)
    drift.plot(0, 0, "k.", ms=9)
    arrow(drift, np.array([30.0, -15]), np.array([30.0 - 6 * np.pi, -15]), GREEN)
    drift.text(9, -15, "−3π a·δa an orbit", color=GREEN, va="center", ha="right")
    drift.axhline(2, color=RED, lw=0.9, ls="--")
    drift.text(-49, -2.2, "a·δa", color=RED)
    drift.set(
        title="roe_m: [2, 30, 0, 10, 0, 0], three orbits", xlabel="T, m", ylim=(-19, 19), xlim=(-50, 46)
    )
    drift.set_aspect("equal")

    for last, colour in (
        ([0.0, 10.0], BLUE),
        ([10.0, 0.0], ORANGE),
    ):
        r = orbit([0, 0, 0, 10, *last])
        tilt.plot(r[:, 2], r[:, 0], color=colour)
    tilt.plot(0, 0, "k.", ms=9)
    tilt.set(title="δi and δe, 10 m each", xlabel="N, m", xlim=(-20, 20), ylim=(-19, 19))
    tilt.set_aspect("equal")
    tilt.text(0, 11.5, "δi ∥ δe", color=BLUE)
    tilt.text(1.5, -14.5, "δi ⊥ δe", color=ORANGE)
    for axes in (ellipse, drift, tilt):
        axes.grid(alpha=0.25)
    save(figure, "roe")


def data_flow() -> None:
    """From the scenario to a frame, and what frames are made into."""
    figure, axes = plt.subplots(figsize=(11, 4.2))
    plain(axes, (-0.3, 13.3), (-0.3, 4.9))

    def box(x: float, y: float, text: str, width: float = 1.75, colour: str = "#eef3f8") -> None:
        patch = FancyBboxPatch((x, y), width, 0.8, boxstyle="round,pad=0.04", fc=colour, ec=GREY)
        axes.add_patch(patch)
        axes.text(x + width / 2, y + 0.4, text, ha="center", va="center", fontsize=9)

    def link(x0: float, y0: float, x1: float, y1: float) -> None:
        arrow(axes, np.array([x0, y0]), np.array([x1, y1]), GREY)

    box(0, 1.8, "scenario\n(YAML)", 1.3)
    box(2.0, 1.8, "simulator", 1.4)
    box(4.1, 1.8, "state", 1.1)
    box(6.0, 3.4, "exact ray-cast")
    box(6.0, 1.8, "renderer")
    box(6.0, 0.2, "sky")
    box(8.5, 3.4, "labels", 1.5, "#e8f3ea")
    box(8.5, 1.0, "sensor model", 1.5)
    box(10.8, 2.2, "frame", 1.1, "#e8f3ea")
    box(10.6, 4.0, "detector, navigator,\ncontroller", 2.4, "#fbf1e2")
    box(10.9, 0.2, "dataset,\nor the caller", 1.8, "#fbf1e2")
    link(1.35, 2.2, 1.95, 2.2)
    link(3.45, 2.2, 4.05, 2.2)
    link(5.25, 2.35, 5.95, 3.6)
    link(5.25, 2.2, 5.95, 2.2)
    link(5.25, 2.05, 5.95, 0.7)
    link(7.8, 3.8, 8.45, 3.8)
    link(7.8, 2.1, 8.45, 1.6)
    link(7.8, 0.6, 8.45, 1.2)
    axes.text(8.12, 2.12, "radiance of\nthe craft", fontsize=7.5, color=GREY, ha="left", va="center")
    axes.text(
        7.95, 0.42, "radiance of everything else", fontsize=7.5, color=GREY, ha="left", va="center"
    )
    link(10.05, 3.7, 10.75, 2.95)
    link(10.05, 1.45, 10.75, 2.3)
    link(11.35, 3.05, 11.5, 3.95)
    link(11.35, 2.15, 11.6, 1.05)
    axes.plot([10.55, 2.7], [4.68, 4.68], color=ORANGE, lw=1.1, ls="--")
    arrow(axes, np.array([2.7, 4.68]), np.array([2.7, 2.65]), ORANGE, dashed=True)
    axes.text(4.4, 4.38, "the next state, in closed loop", color=ORANGE, ha="center", fontsize=8.5)
    save(figure, "data-flow")


if __name__ == "__main__":
    rtn_axes()
    camera_axes()
    relative_orbits()
    data_flow()
