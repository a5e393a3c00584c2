"""How a surface reflects by glTF 2.0, appendix B, for the compiled variants, one of which must be set
before this module is imported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

F0 = 0.04
"""Share of light that the facets of a non-metal reflect straight back."""
LEAST_SHARE = 0.1
"""The least share of paths that leave a coloured non-metal by its facets, and by its base."""


@dataclass
class Surface:
    """Points of surfaces that are each seen from one direction, in arrays of Mitsuba. Both sides are
    alike.

    Attributes:
        wi: unit vector to where it is seen from, axes of Mitsuba's shading frame.
        color: base colour.
        specular, metallic: of a :class:`posse_core.Material`.
        alpha: width of the distribution of facets, the square of the roughness.
        normal: that of its normal map in the shading frame, not of unit length; (0, 0, 1) without.
    """

    wi: Any
    color: Any
    specular: Any
    metallic: Any
    alpha: Any
    normal: Any

    def __post_init__(self) -> None:
        upper = self._on_side(self.wi)
        normal = dr.normalize(self.normal)
        normal = dr.select(dr.dot(normal, upper) > 0, normal, mi.Vector3f(0, 0, 1))
        self._frame = mi.Frame3f(normal)
        self._wi = self._frame.to_local(upper)
        self._f0 = dr.lerp(mi.Color3f(F0 * self.specular), self.color, self.metallic)
        self._f90 = dr.lerp(self.specular, 1, self.metallic)
        self._base = self.color * (1 - self.metallic)
        self._n_v = dr.maximum(self._wi.z, 1e-6)
        self._root_v = self._root(self._n_v)
        fresnel, coat = self._fresnel(self._n_v)
        facets, base = dr.mean(fresnel), dr.mean(self._base) * (1 - coat)
        share = facets / dr.maximum(facets + base, 1e-9)
        share = dr.select(facets == 0, 0, dr.clip(share, LEAST_SHARE, 1 - LEAST_SHARE))
        self._by_facets = dr.select(base == 0, 1, share)

    def reflected(self, wo: Any) -> tuple[Any, Any]:
        """The share of light from ``wo`` (unit vector, shading frame) that goes to the viewer, times the
        cosine of incidence, in three bands, sr⁻¹; and the density with which :meth:`scattered` samples
        ``wo``, sr⁻¹. Both are 0 below the surface."""
        wo, above = self._seen(wo)
        n_l = wo.z
        h = dr.normalize(wo + self._wi)
        v_h = dr.clip(dr.dot(self._wi, h), 0, 1)
        a2 = dr.square(self.alpha)
        # 1 − n_h² is computed from the other components: rounding would spoil a mirror's lobe.
        spread = dr.square(h.x) + dr.square(h.y) + dr.square(h.z) * a2
        distribution = a2 / (dr.pi * dr.square(spread))
        facets = distribution * 0.5 / (n_l * self._root_v + self._n_v * self._root(n_l))
        fresnel, coat = self._fresnel(v_h)
        value = (self._base * ((1 - coat) * dr.inv_pi) + fresnel * facets) * n_l
        pdf = dr.lerp(n_l * dr.inv_pi, distribution * 0.5 / (self._n_v + self._root_v), self._by_facets)
        return dr.select(above, value, 0), dr.select(above, pdf, 0)

    def scattered(self, choice: Any, point: Any) -> Any:
        """A direction in which a path may go on: unit vector, shading frame. Facets are sampled as the
        viewer sees them: Dupuy and Benyoub, Sampling visible GGX normals with spherical caps, 2023.

        Args:
            choice, point: random numbers, in 0 … 1 and in the unit square.
        """
        stretch = mi.Vector3f(self.alpha, self.alpha, 1)
        seen = dr.normalize(self._wi * stretch)
        z = 1 - point.y * (1 + seen.z)
        sine = dr.safe_sqrt(1 - dr.square(z))
        sin, cos = dr.sincos(2 * dr.pi * point.x)
        h: Any = dr.normalize((mi.Vector3f(sine * cos, sine * sin, z) + seen) * stretch)
        mirrored = mi.reflect(self._wi, h)
        wo = dr.select(choice < self._by_facets, mirrored, mi.warp.square_to_cosine_hemisphere(point))
        return self._on_side(self._frame.to_world(wo))

    def _on_side(self, vector: Any) -> Any:
        """A vector of the shading frame as it would be if the surface were seen from above, or back."""
        return mi.Vector3f(vector.x, vector.y, dr.select(self.wi.z < 0, -vector.z, vector.z))

    def _seen(self, wo: Any) -> tuple[Any, Any]:
        """``wo`` in the frame of the normal, and whether it is above the surface."""
        upper = self._on_side(wo)
        local = self._frame.to_local(upper)
        return local, (upper.z > 0) & (local.z > 0)

    def _root(self, cosine: Any) -> Any:
        a2 = dr.square(self.alpha)
        return dr.sqrt(dr.fma(dr.square(cosine), 1 - a2, a2))

    def _fresnel(self, cosine: Any) -> tuple[Any, Any]:
        """Schlick's Fresnel term of the facets in three bands, and that of the coat of a non-metal."""
        edge = (1 - cosine) ** 5
        return self._f0 + (self._f90 - self._f0) * edge, self.specular * (F0 + (1 - F0) * edge)
