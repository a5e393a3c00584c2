"""What can go wrong, and the exit code that each kind ends the program with.

Every message is one line that names the cause and the way out: it is what the user reads.
"""


class PosseError(Exception):
    """Base of all errors that the user is meant to read."""

    exit_code = 3


class CheckFailed(PosseError):
    """A check that the user asked for did not hold (``posse validate``, ``posse crosscheck``)."""

    exit_code = 1


class InputError(PosseError):
    """What the user gave cannot be used: the message names the file, the key, the value, the way out."""

    exit_code = 2


class ComponentError(PosseError):
    """A component that the user chose failed, or cannot be loaded on this machine."""

    exit_code = 3


class WorkerLost(ComponentError):
    """A process that a component works in has died, maybe by chance: the frame is worth another try
    with the component made anew."""


class StoreError(ComponentError):
    """A network store refuses to be read or written: nothing more can be made, nothing is lost."""
