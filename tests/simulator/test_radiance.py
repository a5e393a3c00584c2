"""The sensor `radiance`: the light of the frame's image, before the detector."""

SCRIPT = """
import json
from pathlib import Path
import numpy as np
import OpenEXR
import posse_core as posse

options = {
    "sky.earth": True,
    "sensor": {"noise": {"shot": False, "read_e": 0, "dark_e_s": 0}, "psf": None, "exposure_s": 4e-3},
    "sensors": {
        "exact": {"type": "radiance"},
        "half": {"type": "radiance", "dtype": "float16", "formats": ["exr"]},
        "aside": {"type": "radiance", "mount": {"rotation_vector_deg": [0, 20, 0]}},
    },
}
with posse.open("small.yaml", overrides=options) as sim:
    frame = sim.frame(sim.state(2))
    exact, half, aside = (frame.readings[name][0].arrays["radiance_rgb"] for name in options["sensors"])
    Path("half.exr").write_bytes(frame.readings["half"][0].files[".exr"])
    pitch_m = sim.camera.sensor_width_m / sim.camera.width_px

photons_j = np.array([650e-9, 550e-9, 450e-9]) / (6.62607015e-34 * 299792458.0)
watts = np.pi * exact.astype(float) / (4 * 16**2) * pitch_m**2
electrons = 4e-3 * watts * [0.45, 0.50, 0.40] * photons_j
dn = electrons.sum(axis=2) / (1.05e6 * (pitch_m / 28.125e-6) ** 2 / 255)
with OpenEXR.File("half.exr") as file:
    channels = file.channels()
    read = channels["RGB"].pixels
print(json.dumps({
    "exr": bool((read == half).all() and read.dtype == half.dtype),
    "is the image's": bool((exact == frame.light.radiance_rgb()).all()),
    "shape": exact.shape,
    "kinds": [str(array.dtype) for array in (exact, half, aside)],
    "covered": float(frame.coverage.mean()),
    "off_dn": float(np.abs(frame.image - np.clip(dn, 0, 255)).max()),
    "brightest_dn": float(dn.max()),
    "half_off": float((np.abs(half - exact) / np.maximum(exact, 1e-3)).max()),
    "aside_off": float(np.abs(aside - exact).max()),
}))
"""


def test_the_image_follows_from_the_radiance(run_script) -> None:
    """By the formula of docs/sensor.md."""
    said = run_script(SCRIPT)
    assert said["is the image's"]
    assert said["exr"]
    assert said["shape"] == [48, 64, 3]
    assert said["kinds"] == ["float32", "float16", "float32"]
    assert said["covered"] > 0.01
    assert said["brightest_dn"] > 20
    assert said["off_dn"] < 0.51
    assert said["half_off"] < 2**-11 * 1.001
    assert said["aside_off"] > 1
