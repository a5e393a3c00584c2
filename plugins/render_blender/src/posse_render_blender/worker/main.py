# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker: runs under a Python that has bpy, or inside a blender executable.

    python main.py REQUESTS ANSWERS FOLDER
    blender --background --factory-startup --python main.py -- REQUESTS ANSWERS FOLDER

REQUESTS and ANSWERS are the numbers of inherited file descriptors. Standard output is not used for
messages, because Blender's C code writes to it. FOLDER is the worker's own. When REQUESTS is closed,
even in the middle of a frame, the worker deletes FOLDER and ends.
"""

from __future__ import annotations

import os
import platform
import queue
import shutil
import sys
import threading
import traceback
from io import FileIO

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import wire

OLDEST_BLENDER = (4, 5, 0)


def main() -> None:
    """Send the message ``hello``, then answer one request after another."""
    requests_fd, answers_fd, folder = int(sys.argv[-3]), int(sys.argv[-2]), sys.argv[-1]
    answers = FileIO(answers_fd, "w")
    requests: queue.Queue[wire.Message] = queue.Queue()
    threading.Thread(target=_listen, args=(requests_fd, requests, folder), daemon=True).start()
    try:
        import bpy
    except ImportError as error:
        wire.send(answers, wire.Message("no-bpy", {"cause": f"{type(error).__name__}: {error}"}))
        return
    hello = {"blender": bpy.app.version_string, "python": platform.python_version()}
    hello["oldest"] = ".".join(map(str, OLDEST_BLENDER))
    wire.send(answers, wire.Message("hello" if bpy.app.version >= OLDEST_BLENDER else "too-old", hello))

    from cycles_scene import CyclesScene, choose_device

    scene: CyclesScene | None = None
    while True:
        request = requests.get()
        try:
            if request.kind == "device":
                answer = wire.Message("done", {"device": choose_device(request.values["device"])})
            elif request.kind == "open":
                scene = CyclesScene(request.values, request.arrays)
                answer = wire.Message("done", {"device": scene.device})
            else:
                assert scene is not None, "render was requested before open"
                answer = wire.Message("done", {}, scene.render(request.values, request.arrays))
        except Exception as error:
            traceback.print_exc()
            answer = wire.Message("failed", {"cause": f"{type(error).__name__}: {error}"})
        wire.send(answers, answer)


def _listen(requests_fd: int, requests: queue.Queue[wire.Message], folder: str) -> None:
    source = FileIO(requests_fd, "r")
    try:
        while True:
            requests.put(wire.receive(source))
    except wire.WireError:
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(0)  # no one waits for an answer, and Cycles may be in the middle of a frame


if __name__ == "__main__":
    main()
