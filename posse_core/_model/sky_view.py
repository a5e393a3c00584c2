"""The sky's contribution to an image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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

    def mixed(self, other: SkyView, share: float) -> SkyView:
        """This sky and ``share``, 0 … 1, of another one in its place, as between two instants."""
        images = [
            np.float32(part) * sky.radiance_rgb
            for sky, part in ((self, 1 - share), (other, share))
            if sky.radiance_rgb is not None
        ]
        return SkyView(
            radiance_rgb=sum(images[1:], images[0]) if images else None,
            points_px=np.concatenate([self.points_px, other.points_px]),
            points_irradiance_rgb_w_m2=np.concatenate(
                [
                    (1 - share) * self.points_irradiance_rgb_w_m2,
                    share * other.points_irradiance_rgb_w_m2,
                ]
            ),
        )
