"""A tiny render with one variant, run in a child process because an unsuitable LLVM aborts the
process."""

from __future__ import annotations

import sys


def main(variant: str) -> None:
    """Print ``usable`` if ``variant`` renders a lit sphere."""
    import mitsuba as mi
    import numpy as np

    mi.set_variant(variant)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 3},
            "ball": {"type": "sphere", "bsdf": {"type": "twosided", "bsdf": {"type": "principled"}}},
            "sun": {"type": "directional", "direction": [0, 0, 1]},
            "sensor": {
                "type": "perspective",
                "to_world": mi.ScalarTransform4f().look_at([0, 0, -5], [0, 0, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 8, "height": 8},
            },
        }
    )
    image = np.array(mi.render(scene, spp=4))
    if not (np.isfinite(image).all() and image.max() > 0):
        raise SystemExit("it renders a lit sphere as black or with values that are not finite")
    print("usable")


if __name__ == "__main__":
    main(sys.argv[1])
