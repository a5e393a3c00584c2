"""A frame worker that makes up its frames quickly, and comes to grief where it is told to.

Apart from ``faults.py``, so that the processes of a pool import no more than this.
"""

import hashlib
import os
import random
import signal
import time
from pathlib import Path

from posse_core._files.store import open_store
from posse_core._interfaces.executor import FrameMade
from posse_core._model.label_line import LabelLine


class FaultyWorker:
    """Args: faults: frame → what happens there, once (a file in ``marks`` tells that it has)."""

    def __init__(self, location: str, faults: dict[int, str], marks: Path) -> None:
        self._store = open_store(location)
        self._faults = faults
        self._marks = marks
        self._store.write("renderer.json", b"{}\n")

    def make(self, index: int) -> FrameMade:
        draw = random.Random(index)
        names = (f"images/{index:06d}.png", f"truth/{index:06d}.npz")
        files = {name: draw.randbytes(draw.randint(0, 3000)) for name in names}
        for stage, (name, data) in enumerate(files.items()):
            self._suffer(index, stage)
            self._store.write(name, data)
        self._suffer(index, len(files))
        labels = LabelLine(
            index=index,
            t_s=10.0 * index,
            epoch_utc="2022-01-31T02:02:27.580416",
            sequence=0,
            spacecraft="box",
            sun_fraction_target=1.0,
            sun_fraction_camera=1.0,
            solar_flux_w_m2=1361.0,
            image=names[0],
            truth=names[1],
            q_cam_from_body=(1.0, 0.0, 0.0, 0.0),
            t_body_cam_m=(draw.uniform(-5, 5), draw.uniform(-5, 5), draw.uniform(20, 90)),
            note={"text": "ß" * draw.randint(0, 300)},
        )
        return FrameMade(
            labels, {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
        )

    def _suffer(self, index: int, stage: int) -> None:
        kind, _, at = self._faults.get(index, "").partition(" at ")
        mark = self._marks / f"{index}"
        if not kind or int(at) != stage or mark.exists():
            return
        mark.touch()
        if kind == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(3600)

    def close(self) -> None:
        pass
