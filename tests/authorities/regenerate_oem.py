"""Makes oem.json: states that the library oem interpolates, which POSSE does not use.

python -m venv v && v/bin/pip install oem .
v/bin/python tests/authorities/regenerate_oem.py
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from astropy.time import Time, TimeDelta
from oem import OrbitEphemerisMessage

sys.path.insert(0, str(Path(__file__).parents[1]))
from test_recorded_times import EPOCH, TARGET, meta, write_oem

METHODS = (("HERMITE", 7, 1e-5, 1e-6), ("LAGRANGE", 7, 1e-5, 1e-6))


def main() -> None:
    t_s = 120.0 * np.arange(12)
    at_s = np.array([1.0, 33.0, 301.5, 610.0, 777.7, 1290.0])
    cases = []
    for method, degree, atol_m, atol_m_s in METHODS:
        with tempfile.TemporaryDirectory() as folder:
            path = write_oem(Path(folder) / "a.oem", TARGET, t_s, meta(method, degree))
            ephemeris = OrbitEphemerisMessage.open(path)
            start = Time(EPOCH, scale="utc")
            states = [ephemeris(start + TimeDelta(float(x), format="sec")) for x in at_s]
            cases.append(
                {
                    "method": method,
                    "text": path.read_text(),
                    "r_m": [[1e3 * float(x) for x in state.position] for state in states],
                    "v_m_s": [[1e3 * float(x) for x in state.velocity] for state in states],
                    "atol_m": atol_m,
                    "atol_m_s": atol_m_s,
                }
            )
    out = Path(__file__).parent / "oem.json"
    out.write_text(json.dumps({"t_s": at_s.tolist(), "cases": cases}, indent=1) + "\n")


if __name__ == "__main__":
    main()
