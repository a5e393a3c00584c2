"""A robotic arm, such as a servicer carries: two limbs, a wrist and a gripper, all of them on joints.

Body axes: the foot stands on the plane z = 0, and the arm is stretched along +Z when every joint is at
zero; with the foot mounted on a chaser without a rotation, that is where the camera looks. The shoulder
and the elbow turn about X, and the fingers close along Y.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from posse_core._frames import R_from_z
from posse_core._model.joints import Joint
from posse_core._spacecraft.assembly import Assembly
from posse_core._spacecraft.finishes import Finish, common_finishes
from posse_core._spacecraft.options import VariantOptions
from posse_core._spacecraft.parametric import Parametric
from posse_core._spacecraft.shapes import Mesh, box, cylinder, frustum, ring, tube

FOOT = 0.10
"""Height of the shoulder's axis above the foot, in lengths of the arm; so are all of these."""
UPPER, LOWER = 0.45, 0.35
"""Lengths of the limbs between the axes of shoulder, elbow and wrist."""
PALM = 0.06
FINGER = (0.022, 0.012, 0.075)
OPEN = 0.045
"""How far a finger's inner face is from the middle of the open gripper."""


class ArmOptions(VariantOptions):
    """Options of the arm."""

    length_m: float = Field(
        1.2, gt=0.05, lt=50.0, description="length from the foot to the wrist, about"
    )
    thickness: float = Field(
        0.035, ge=0.015, le=0.06, description="radius of the limbs as a share of the length"
    )


class Arm(Parametric[ArmOptions]):
    """The scene source ``arm``."""

    name = "arm"
    centre_of_mass_m = (0.0, 0.0, 0.0)
    skeleton = (("B1", "T1"), ("T1", "T2"), ("T2", "A1"), ("A1", "A2"), ("A1", "A3"))
    loose = ()

    def assemble(self, craft: Assembly, lean: float) -> None:
        length, r = self.options.length_m, self.options.thickness * self.options.length_m
        shoulder, elbow, wrist = np.cumsum([FOOT, UPPER, LOWER]) * length
        across, along = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])

        def hinge(name: str, z: float, parent: str, reach_deg: float) -> None:
            limit = float(np.radians(reach_deg))
            craft.hang(Joint(name, "revolute", z * along, across, parent, (-limit, limit)))

        craft.hang(Joint("turret", "revolute", np.zeros(3), along))
        hinge("shoulder", shoulder, "turret", 120.0)
        hinge("elbow", elbow, "shoulder", 150.0)
        craft.hang(Joint("wrist", "revolute", np.zeros(3), along, "elbow"))
        open_m = OPEN * length
        for side, sign in (("left", 1.0), ("right", -1.0)):
            axis = np.array([0.0, -sign, 0.0])
            craft.hang(Joint(f"finger_{side}", "prismatic", np.zeros(3), axis, "wrist", (0.0, open_m)))

        craft.add("foot", "aluminium", cylinder(1.9 * r, 0.6 * r), cylinder(1.3 * r, 1.0 * r))
        craft.mark("B1", "foot", (1.9 * r, 0.0, 0.6 * r))
        post = frustum(1.2 * r, 1.0 * r, shoulder - 2.2 * r).at((0.0, 0.0, 1.1 * r))
        craft.add("turret", "white_paint", post, *_fork(shoulder, r), joint="turret")
        craft.mark("T1", "turret", (1.75 * r, 0.0, shoulder))
        craft.add("upper_arm", "white_paint", *_limb(shoulder, elbow, r), joint="shoulder")
        craft.add("upper_bands", "black_paint", *_bands(shoulder, elbow, r), joint="shoulder")
        craft.mark("T2", "upper_arm", (1.75 * r, 0.0, elbow))
        craft.add("lower_arm", "white_paint", *_rod(elbow, wrist - 1.2 * r, 0.85 * r), joint="elbow")
        craft.add("lower_bands", "black_paint", *_bands(elbow, wrist - r, 0.85 * r), joint="elbow")
        palm = cylinder(1.15 * r, PALM * length, 40).at((0.0, 0.0, wrist - 1.1 * r))
        craft.add("palm", "aluminium", palm, joint="wrist")
        front = wrist - 1.1 * r + PALM * length
        rail = box((0.5 * r, 2.2 * open_m + 0.06 * length, 0.3 * r)).at((0.0, 0.0, front + 0.15 * r))
        craft.add("rail", "titanium", rail, joint="wrist")
        craft.mark("A1", "palm", (1.15 * r, 0.0, front))
        for number, (side, sign) in enumerate((("left", 1.0), ("right", -1.0)), start=2):
            x, y, z = np.array(FINGER) * length
            middle = (0.0, sign * (open_m + y / 2), front + 0.35 * r + z / 2)
            finger = box((x, y, z)).at(middle)
            craft.add(f"finger_{side}", "titanium", finger, joint=f"finger_{side}")
            craft.mark(f"A{number}", f"finger_{side}", (x / 2, sign * open_m, middle[2] + z / 2))

    def finishes(self, seed: int) -> dict[str, Finish]:
        return common_finishes(seed)


def _across(radius_m: float, width_m: float, z_m: float, x_m: float = 0.0) -> Mesh:
    """A drum about an axis along x, whose middle is at (x, 0, z)."""
    turn = R_from_z((1.0, 0.0, 0.0))
    return cylinder(radius_m, width_m, 36).at((x_m - width_m / 2, 0.0, z_m), turn)


def _fork(z_m: float, r: float) -> list[Mesh]:
    """Two cheeks that hold a drum at height z."""
    cheeks = [_across(1.25 * r, 0.5 * r, z_m, sign * 1.5 * r) for sign in (-1.0, 1.0)]
    yoke = box((3.5 * r, 1.3 * r, 0.4 * r)).at((0.0, 0.0, z_m - 1.45 * r))
    webs = [box((0.45 * r, 1.2 * r, 1.4 * r)).at((s * 1.5 * r, 0.0, z_m - 0.8 * r)) for s in (-1, 1)]
    return [*cheeks, yoke, *webs]


def _limb(start_m: float, end_m: float, r: float) -> list[Mesh]:
    """A drum at its start, a rod, and a fork that holds the next limb's drum."""
    drum = _across(1.15 * r, 2.4 * r, start_m)
    rod = tube([(0.0, 0.0, start_m + r), (0.0, 0.0, end_m - 1.5 * r)], r, 36)
    return [drum, rod, *_fork(end_m, r)]


def _rod(start_m: float, end_m: float, r: float) -> list[Mesh]:
    """A drum at its start, and a rod that becomes wider at its end."""
    drum = _across(1.3 * r, 2.7 * r, start_m)
    rod = tube([(0.0, 0.0, start_m + r), (0.0, 0.0, end_m)], r, 36)
    return [drum, rod, frustum(r, 1.3 * r, 0.8 * r, 36).at((0.0, 0.0, end_m - 0.9 * r))]


def _bands(start_m: float, end_m: float, r: float) -> list[Mesh]:
    """Two dark rings around a limb, which show how it turns."""
    length = end_m - start_m
    return [
        ring(0.98 * r, 1.06 * r, 0.05 * length, 36).at((0.0, 0.0, start_m + share * length))
        for share in (0.35, 0.6)
    ]
