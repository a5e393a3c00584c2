"""A real browser that tests drive by real events: headless Chromium over its remote debugging pipe."""

from __future__ import annotations

import base64
import contextlib
import fcntl
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

REQUIRED = "POSSE_REQUIRE_CHROMIUM"
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-pipe",
)
_MODIFIERS = {"shift": 8}


def chromium() -> str:
    """The browser's command; skips the test where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None and os.environ.get(REQUIRED) == "1":
        pytest.fail(f"no Chromium on this machine ({REQUIRED}=1)")
    if found is None:
        pytest.skip("no Chromium on this machine: the page is judged by its data alone")
    return found


class Tab:
    """A page in the browser. Positions of the pointer are in CSS pixels of the window."""

    def __init__(self, process: subprocess.Popen[bytes], to: int, answers: int) -> None:
        self._process, self._to, self._answers = process, to, answers
        self._buffer, self._number, self._session = b"", 0, ""
        self.errors: list[str] = []
        """What the page raised, or logged as an error."""

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of Chromium's DevTools protocol, and return its result."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while (answer := self._read()).get("id") != self._number:
            self._note(answer)
        assert "error" not in answer, f"{method}: {answer['error']}"
        result: dict[str, Any] = answer["result"]
        return result

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            data = os.read(self._answers, 1 << 20)
            assert data, "the browser has ended"
            self._buffer += data
        message, _, self._buffer = self._buffer.partition(b"\0")
        value: dict[str, Any] = json.loads(message)
        return value

    def _note(self, event: dict[str, Any]) -> None:
        parameters = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif event.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(parameters["entry"]["text"])
        elif event.get("method") == "Runtime.consoleAPICalled" and parameters["type"] == "error":
            self.errors.append(str(parameters["args"]))

    def open(self, page: Path, width: int, height: int, downloads: Path) -> None:
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        attached = self.send("Target.attachToTarget", targetId=target, flatten=True)
        self.send("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(downloads))
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.send(f"{domain}.enable")
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        self.send("Page.navigate", url=page.as_uri())
        self.tell("new Promise((done) => document.readyState === 'complete' ? done() : onload = done)")

    def tell(self, expression: str) -> Any:
        """The value of an expression in the page, after what it promises."""
        answer = self.send(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def place(self, selector: str) -> tuple[float, float, float, float]:
        """Left, top, width and height of an element."""
        x, y, width, height = self.tell(
            f"(({{ x, y, width, height }}) => [x, y, width, height])"
            f"(document.querySelector({json.dumps(selector)}).getBoundingClientRect())"
        )
        return x, y, width, height

    def pointer(self, kind: str, x: float, y: float, *held: str, **more: Any) -> None:
        modifiers = sum(_MODIFIERS[key] for key in held)
        self.send("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, modifiers=modifiers, **more)

    def move(self, x: float, y: float) -> None:
        self.pointer("Moved", x, y)

    def click(self, x: float, y: float) -> None:
        self.move(x, y)
        self.pointer("Pressed", x, y, button="left", clickCount=1)
        self.pointer("Released", x, y, button="left", clickCount=1)

    def press(self, selector: str) -> None:
        """Click the middle of an element."""
        x, y, width, height = self.place(selector)
        self.click(x + width / 2, y + height / 2)

    def drag(self, start: tuple[float, float], end: tuple[float, float], *held: str) -> None:
        self.move(*start)
        self.pointer("Pressed", *start, *held, button="left", clickCount=1)
        for share in (0.25, 0.5, 0.75, 1.0):
            at = [a + share * (b - a) for a, b in zip(start, end, strict=True)]
            self.pointer("Moved", *at, *held, button="left", buttons=1)
        self.pointer("Released", *end, *held, button="left", clickCount=1)

    def wheel(self, x: float, y: float, by: float) -> None:
        self.pointer("Wheel", x, y, deltaX=0, deltaY=by)
        self.tell("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def key(self, key: str, code: int) -> None:
        """Press a key that is no letter."""
        for kind in ("rawKeyDown", "keyUp"):
            self.send("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code)

    def type(self, text: str) -> None:
        """Type into the element that has the focus."""
        self.send("Input.insertText", text=text)

    def picture(self) -> bytes:
        """The window as a PNG file."""
        return base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"])


def _pipe() -> tuple[int, int]:
    """The ends of a pipe, whose numbers are above those that the browser asks for."""
    ends = os.pipe()
    above = tuple(fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in ends)
    for end in ends:
        os.close(end)
    return above[0], above[1]


@contextlib.contextmanager
def opened(page: Path, downloads: Path, *, width: int = 1400, height: int = 900) -> Iterator[Tab]:
    """A page in a browser of its own, which ends with the block.

    Args:
        downloads: folder for what the page saves.
    """
    command = chromium()
    (ours, to), (answers, theirs) = _pipe(), _pipe()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        # The browser reads from descriptor 3 and writes to 4.
        process = subprocess.Popen(
            [
                "bash",
                "-c",
                f'exec "$@" 3<&{ours} 4>&{theirs}',
                "bash",
                command,
                *_FLAGS,
                f"--user-data-dir={profile}",
                "about:blank",
            ],
            pass_fds=(ours, theirs),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(ours)
        os.close(theirs)
        tab = Tab(process, to, answers)
        try:
            tab.open(page, width, height, downloads)
            yield tab
        finally:
            with contextlib.suppress(OSError, AssertionError):
                tab._session = ""
                tab.send("Browser.close")
            os.close(to)
            os.close(answers)
            try:
                process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
