"""POSSE's side of the child process that runs Cycles (here called its worker): starts it, sends it
requests, reports how it died, and ends it."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import tempfile
from io import FileIO
from pathlib import Path

from posse_core import ComponentError, WorkerLost
from posse_render_blender.interpreter import WAY_OUT, Interpreter
from posse_render_blender.worker.wire import Message, WireClosed, WireError, receive, send

START_LIMIT_S = 120.0
"""Blender starts in one or two seconds, or in a minute from a cold network disk."""
END_LIMIT_S = 5.0
LOG_TAIL_CHARS = 600


class Child:
    """One worker process.

    It has its own folder for its log and Blender's temporary files, which is deleted when it ends. The
    worker ends by itself when this process is gone, because its pipe then closes.
    """

    def __init__(self, interpreter: Interpreter) -> None:
        """Start the process.

        Raises:
            ComponentError: the process cannot be started, does not answer, or has no bpy or one that is
                too old.
        """
        self._interpreter = interpreter
        self._folder = tempfile.TemporaryDirectory(prefix="posse-blender-", ignore_cleanup_errors=True)
        # The log is kept open so that a clean-up of the temporary folder does not end a run. It is
        # opened for appending because it is truncated while the worker writes to it.
        self._log_file = FileIO(Path(self._folder.name) / "log.txt", "a+")
        with contextlib.ExitStack() as on_failure:
            on_failure.callback(self._folder.cleanup)
            on_failure.callback(self._log_file.close)
            self._process = self._start()
            on_failure.callback(self.close)
            self._receive_hello()
            on_failure.pop_all()

    @property
    def pid(self) -> int:
        """Process id of the worker."""
        return self._process.pid

    def ask(self, message: Message, doing: str) -> Message:
        """Send a request and wait for its answer.

        Args:
            message: the request.
            doing: what the request is for, in words, for error messages.

        Raises:
            ComponentError: the worker reports a failure.
            WorkerLost: the worker died; the message contains the end of its log.
        """
        self._log_file.truncate(0)  # so that the log in an error message is that of this request
        try:
            send(self._requests, message)
            answer = receive(self._answers)
        except (BrokenPipeError, WireClosed):
            raise WorkerLost(f"blender: {self._how_it_ended()} while {doing}{self._log()}") from None
        except WireError as error:
            raise ComponentError(
                f"blender: unreadable answer of the worker while {doing}: {error}"
            ) from None
        if answer.kind == "failed":
            raise ComponentError(f"blender: {doing} failed: {answer.values['cause']}")
        return answer

    def close(self) -> None:
        """End the process. Further calls have no effect."""
        self._requests.close()
        try:
            self._process.wait(END_LIMIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._answers.close()
        self._log_file.close()
        self._folder.cleanup()

    def _start(self) -> subprocess.Popen[bytes]:
        folder = Path(self._folder.name)
        requests_out, requests_in = os.pipe()
        answers_out, answers_in = os.pipe()
        self._requests = FileIO(requests_in, "w")
        self._answers = FileIO(answers_out, "r")
        try:
            return subprocess.Popen(
                self._interpreter.command(requests_out, answers_in, folder),
                stdin=subprocess.DEVNULL,
                stdout=self._log_file,
                stderr=subprocess.STDOUT,
                env=self._interpreter.environment(os.environ, folder),
                pass_fds=(requests_out, answers_in),
                start_new_session=True,  # Ctrl-C reaches this process only, which then ends the worker
            )
        except OSError as error:
            self._requests.close()
            self._answers.close()
            reason = f"cannot be started: {error.strerror}"
            raise ComponentError(f"blender: {self._interpreter} {reason}; {WAY_OUT}") from None
        finally:
            os.close(requests_out)
            os.close(answers_in)

    def _receive_hello(self) -> None:
        what = f"blender: {self._interpreter}"
        try:
            if not select.select([self._answers], [], [], START_LIMIT_S)[0]:
                raise ComponentError(f"{what} did not answer in {START_LIMIT_S:.0f} s; {WAY_OUT}")
            hello = receive(self._answers)
        except WireError:
            kind = "Blender" if self._interpreter.is_blender else "Python with bpy"
            how = f"{self._how_it_ended()} before it answered{self._log()}"
            raise ComponentError(f"{what} is not a {kind}: {how}; {WAY_OUT}") from None
        if hello.kind == "no-bpy":
            raise ComponentError(f"{what} has no usable bpy: {hello.values['cause']}; {WAY_OUT}")
        if hello.kind == "too-old":
            versions = f"Blender {hello.values['blender']}, older than {hello.values['oldest']}"
            raise ComponentError(f"{what} has {versions}; {WAY_OUT}")
        self.blender_version = str(hello.values["blender"])
        self.python_version = str(hello.values["python"])

    def _how_it_ended(self) -> str:
        try:
            code = self._process.wait(END_LIMIT_S)
        except subprocess.TimeoutExpired:
            return f"its worker (process {self.pid}) closed its pipe"
        if code >= 0:
            return f"its worker (process {self.pid}) ended with exit code {code}"
        name = signal.Signals(-code).name
        return f"its worker (process {self.pid}) was ended by {name}"

    def _log(self) -> str:
        self._log_file.seek(0)
        text = self._log_file.readall().decode(errors="replace")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        tail = " | ".join(lines)[-LOG_TAIL_CHARS:]
        return f"; the end of its log: {tail}" if tail else "; its log is empty"
