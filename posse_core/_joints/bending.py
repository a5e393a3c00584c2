"""A wing of several panels that bends in its first mode."""

from __future__ import annotations

import itertools

import numpy as np

from posse_core._arrays import FloatArray
from posse_core._errors import InputError
from posse_core._frames import unit
from posse_core._interfaces.joint_law import JointLaw, JointSurroundings
from posse_core._joints.options import BendingOptions
from posse_core._model.joints import Articulation, Joint
from posse_core._model.spacecraft import Spacecraft

LAMBDA, SIGMA = 1.875104068711961, 0.7340955137589128
"""Of the first mode of a uniform beam, clamped at one end and free at the other: the first root of
cos λ cosh λ = −1, and (sinh λ − sin λ) / (cosh λ + cos λ). Blevins, Formulas for Natural Frequency and
Mode Shape, 1979, Table 8-1."""
MOST_SHARE = 0.3
"""Amplitude at the tip, as a share of the wing's length, beyond which small deflections end."""
_STRAIGHT = 1e-3
"""How far from parallel axes and from one line hinges may be, as sines of angles."""


def first_mode(x: FloatArray) -> FloatArray:
    """Deflection of the first mode at shares x (N,) of the length from the clamp; 1 at the tip."""
    z = LAMBDA * x
    shape = np.cosh(z) - np.cos(z) - SIGMA * (np.sinh(z) - np.sin(z))
    tip = np.cosh(LAMBDA) - np.cos(LAMBDA) - SIGMA * (np.sinh(LAMBDA) - np.sin(LAMBDA))
    return np.asarray(shape / tip)


class BendingLaw(JointLaw[BendingOptions]):
    """Bends a row of hinges in the first mode of a clamped beam.

    The row are those joints of the law's group that carry this one or are carried by it. The beam is
    clamped at the first hinge and ends with what the last one carries. Hinges and tip are on the beam,
    with stiff panels between them, which keep their lengths. So the tip is deflected by exactly the
    amplitude across the wing; it is positive towards the cross product of axis and wing.

    The deflection is amplitude · exp(−ζ ω t) · cos(ω √(1 − ζ²) t + phase), t since the epoch.
    """

    _known: tuple[Spacecraft, tuple[str, ...], int, FloatArray] | None = None

    def values(self, around: JointSurroundings) -> FloatArray:
        """See :meth:`JointLaw.values`.

        Raises:
            InputError: The joint does not turn, or the hinges are not parallel or not in one line, or
                the amplitude is too large for the wing.
        """
        options = self.options
        number, places_m = self._place(around)
        length_m = float(places_m[-1])
        if abs(options.amplitude_m) > MOST_SHARE * length_m:
            raise InputError(
                f"bending: amplitude_m {options.amplitude_m:g} is more than {MOST_SHARE:g} of the wing's"
                f" {length_m:.4g} m, beyond which a beam's mode does not hold"
            )
        omega_rad_s = 2.0 * np.pi * options.frequency_hz
        damped_rad_s = omega_rad_s * np.sqrt(1.0 - options.damping_ratio**2)
        decay = np.exp(-options.damping_ratio * omega_rad_s * around.t_s)
        phase = damped_rad_s * around.t_s + np.radians(options.phase_deg)
        tip_m = options.amplitude_m * decay * np.cos(phase)
        rise = np.diff(first_mode(places_m / length_m)) / np.diff(places_m)
        slope = np.arcsin(np.clip(tip_m * rise[number], -1.0, 1.0))
        if number == 0:
            return np.asarray(slope)
        return np.asarray(slope - np.arcsin(np.clip(tip_m * rise[number - 1], -1.0, 1.0)))

    def _place(self, around: JointSurroundings) -> tuple[int, FloatArray]:
        """The joint's number in its row, and the places of the row and its tip; found once."""
        craft, names = around.spacecraft, (around.joint.name, *around.group)
        if self._known is None or self._known[0] is not craft or self._known[1] != names:
            row = _row(around)
            number = [joint.name for joint in row].index(around.joint.name)
            self._known = (craft, names, number, _places_m(around, row))
        return self._known[2:]


def _row(around: JointSurroundings) -> list[Joint]:
    """The joints of the group that carry the law's joint or are carried by it, from the body outward."""
    craft = around.spacecraft
    tree = Articulation(craft.joints)
    of = {joint.name: set(tree.chain(craft.link_of(joint.name))) for joint in craft.joints}
    own = craft.link_of(around.joint.name) - 1
    row = [
        joint
        for number, joint in enumerate(craft.joints)
        if joint.name in around.group and (number in of[around.joint.name] or own in of[joint.name])
    ]
    for joint, after in itertools.pairwise(row):
        if craft.link_of(joint.name) - 1 not in of[after.name]:
            raise InputError(f"bending: {joint.name} and {after.name} are not in one row of hinges")
    if any(joint.kind != "revolute" for joint in row):
        raise InputError("bending: a joint of the row slides; take the law fixed, rate or table")
    return row


def _places_m(around: JointSurroundings, row: list[Joint]) -> FloatArray:
    """(K + 1,) distances of the hinges and of the tip along the wing, from the first hinge, m."""
    first, axis = row[0], row[0].axis_body
    carried = [
        part.vertices_body_m - first.origin_body_m
        for part in around.spacecraft.parts
        if part.joint is not None and _carries(around, row[-1], part.joint)
    ]
    if not carried:
        raise InputError(f"bending: {row[-1].name} carries no part, so the wing has no tip")
    beyond_m = np.concatenate(carried)
    hinges_m = np.array([joint.origin_body_m - first.origin_body_m for joint in row])
    target_m = hinges_m[-1] if len(row) > 1 else beyond_m.mean(axis=0)
    across = target_m - axis * (axis @ target_m)
    if not np.linalg.norm(across) > 0.0:
        raise InputError(f"bending: nothing that {first.name} carries is beside its axis")
    along = unit(across)
    # The hinges' axes are parallel, and a plane through the first axis contains them all.
    out_m = np.abs(hinges_m @ np.cross(axis, along))
    parallel = all(np.linalg.norm(joint.axis_body - axis) < _STRAIGHT for joint in row)
    places_m = np.append(hinges_m @ along, (beyond_m @ along).max())
    if not parallel or np.any(out_m > _STRAIGHT * places_m[-1]) or np.any(np.diff(places_m) <= 0.0):
        names = ", ".join(joint.name for joint in row)
        raise InputError(f"bending: {names} are not parallel hinges one after the other in a flat wing")
    return places_m


def _carries(around: JointSurroundings, joint: Joint, name: str) -> bool:
    """Whether a joint carries another, or is it."""
    craft = around.spacecraft
    tree = Articulation(craft.joints)
    return craft.link_of(joint.name) - 1 in set(tree.chain(craft.link_of(name)))
