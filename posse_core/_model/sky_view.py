"""The sky's contribution to an image."""

from __future__ import annotations

from dataclasses import dataclass

from posse_core._arrays import Float32Array, FloatArray


@dataclass(frozen=True)
class SkyView:
    """The sky behind the spacecraft, as the camera sees it.

    Attributes:
        radiance_rgb: (H, W, 3) float32 W m⁻² sr⁻¹ in the red, green and blue band, averaged over each
            pixel; None if all of it is black.
        points_px: (S, 2) image positions (u, v) of point sources, some of them a little outside the
            image.
        points_irradiance_rgb_w_m2: (S, 3) their irradiance at the camera on a plate that faces them, by
            band.
    """

    radiance_rgb: Float32Array | None
    points_px: FloatArray
    points_irradiance_rgb_w_m2: FloatArray
