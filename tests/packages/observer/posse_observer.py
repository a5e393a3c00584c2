"""An observer that raises, which must not end the run."""

from posse_core import hookimpl


@hookimpl
def posse_frame_completed(index):
    raise RuntimeError(f"frame {index} is not to my liking")
