"""What single rays hit, each cast at an instant of its own."""

from __future__ import annotations

from dataclasses import dataclass

from posse_core._arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class RayHits:
    """The first point of a body on each of N rays.

    "The ray's axes" are those in which the rays were given, each at its own instant: they move with the
    camera or the sensor.

    Attributes:
        distance_m: (N,) distance from the ray's origin; infinite where nothing is hit.
        triangle: (N,) index of the triangle, counted through the faces of ``scene.pieces`` in
            order; −1 where nothing is hit.
        part_id: (N,) int16 index in ``scene.pieces``, which for the target is that in
            ``spacecraft.parts``; −1 where nothing is hit.
        normal: (N, 3) unit geometric normal on the side that the ray comes from, in the ray's axes; NaN
            where nothing is hit.
        point_body_m: (N, 3) the point in the axes of its own body, where it is with every joint at zero;
            NaN where nothing is hit.
        lit: (N,) bool, whether the point faces the Sun's centre on the ray's side and no part is in
            between. Eclipses by the Earth are not considered.
    """

    distance_m: FloatArray
    triangle: IntArray
    part_id: IntArray
    normal: FloatArray
    point_body_m: FloatArray
    lit: BoolArray

    @property
    def hit(self) -> BoolArray:
        """(N,) bool, whether the ray hits a body."""
        return self.triangle >= 0
