# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders frames by BlenderProc, as the reference of ``renderers.py``, which starts it:

    python blenderproc_worker.py WORKER FOLDER SAMPLES SEED SEED ...

It runs under a Python 3.11 with BlenderProc, Blender, and what BlenderProc installs into Blender by
itself: ``pip install blenderproc bpy==4.2.0 "numpy<2" imageio==2.34.1 h5py==3.11.0 trimesh==4.4.0
opencv-contrib-python-headless==4.10.0.82 scikit-image==0.23.2 scipy==1.13.1 scikit-learn==1.5.0
matplotlib==3.9.0 rich gitpython pypng pyrender pytz``.

WORKER is the folder of the worker of ``posse-render-blender``, which builds the same scene as for the
renderer ``blender``; FOLDER has the messages ``scene`` and ``frame0``, ``frame1``, ... that it is built
of. BlenderProc renders the whole image of each frame with its depth, normals and segments, and reads
them back, as a script that makes a labelled dataset with it does; without a denoiser, and with SAMPLES
samples in every pixel. For each SEED it leaves the frames' images, (H, W, 4) radiance and coverage, as
``SEED-0.npy``, ``SEED-1.npy`` and so on, and the CPU seconds of all in ``costs.json``. A first frame,
which compiles, is left out.
"""

from __future__ import annotations

import json
import os
import site
import sys
import time
from io import FileIO
from pathlib import Path
from types import ModuleType
from typing import Any


def imported() -> Any:
    """BlenderProc beside a Blender that is a module.

    Its own set-up would install packages into the folder of a Blender application, and takes the
    packages of this Python away.
    """

    class Installed:
        """Stands for the set-up."""

        @staticmethod
        def setup(*arguments: object) -> None:
            sys.path.extend(site.getsitepackages())

    stand_in = ModuleType("SetupUtility")
    vars(stand_in)["SetupUtility"] = Installed
    sys.modules["blenderproc.python.utility.SetupUtility"] = stand_in
    os.environ["INSIDE_OF_THE_INTERNAL_BLENDER_PYTHON_ENVIRONMENT"] = "1"
    import blenderproc

    return blenderproc


def main() -> None:
    """Render all frames by each seed."""
    worker, folder, samples = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    sys.path.insert(0, worker)
    import bpy  # before BlenderProc, which looks for it in a Blender application
    import numpy as np
    import wire
    from cycles_scene import CyclesScene

    bproc = imported()
    from blenderproc.python.utility.Utility import Utility, reset_keyframes

    Utility.temp_dir = str(folder)

    def message(path: Path) -> Any:
        with FileIO(str(path)) as file:
            return wire.receive(file)

    opened = message(folder / "scene")
    scene = CyclesScene(opened.values, opened.arrays)
    bproc.renderer.set_max_amount_of_samples(samples)
    bproc.renderer.set_noise_threshold(0)
    bproc.renderer.set_denoiser(None)
    bproc.renderer.set_output_format("OPEN_EXR", 32, enable_transparency=True)
    bproc.renderer.enable_depth_output(activate_antialiasing=False)
    bproc.renderer.enable_normals_output()
    bproc.renderer.enable_segmentation_output(map_by=["instance"])

    def rendered(frame: Any, seed: int) -> Any:
        scene.place(frame.values, frame.arrays)
        bpy.context.scene.cycles.seed = seed
        reset_keyframes()
        bproc.camera.add_camera_pose(bpy.context.scene.camera.matrix_world)
        return bproc.renderer.render()["colors"][0]

    frames = [message(folder / f"frame{i}") for i in range(len(list(folder.glob("frame*"))))]
    rendered(frames[0], 0)
    costs: dict[int, list[tuple[float, float]]] = {}
    for seed in map(int, sys.argv[4:]):
        costs[seed] = []
        for i, frame in enumerate(frames):
            cpu_s, wall_s = time.process_time(), time.perf_counter()
            image = rendered(frame, seed)
            costs[seed].append((time.process_time() - cpu_s, time.perf_counter() - wall_s))
            np.save(folder / f"{seed}-{i}.npy", image)
    (folder / "costs.json").write_text(json.dumps(costs), encoding="utf-8")
    sys.stdout.flush()
    os._exit(0)  # Blender as a module may crash where Python takes it down


if __name__ == "__main__":
    main()
