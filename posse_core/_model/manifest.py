"""The manifest of a dataset: what it was made from, whether it is whole, the digests of its files."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError

from posse_core._errors import InputError

FORMAT: Final = "posse-dataset"
FORMAT_VERSION: Final = 1
CHECKSUMS: Final = "checksums.sha256"
"""The list of the digests of images and arrays, in the format of the tool ``sha256sum``."""

State = Literal["complete", "incomplete"]
Count = Annotated[int, Field(ge=0)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True)


class PluginVersion(_Record):
    """A plugin that was there when the run ended: its distribution, and what became of it."""

    dist: str
    version: str
    state: str


class Source(_Record):
    """A dataset that ``posse collect`` took frames from.

    Attributes:
        dataset: name of its folder.
        scenario: the copy of its scenario beside the manifest; None where it had none.
        frames, seed, renderer, versions, sources: as its own manifest has them.
    """

    dataset: str
    scenario: str | None
    frames: Count
    seed: int | None = None
    renderer: dict[str, JsonValue] | None = None
    versions: dict[str, str] = Field(default_factory=dict)
    sources: list[Source] | None = None


class Selection(_Record):
    """What a rule of ``posse collect`` did.

    Attributes:
        why: the rule in words.
        dropped: number of frames.
        bins: of the rule ``balance``: the names of each bin, the frames there were, and those kept.
    """

    rule: str
    why: str
    dropped: Count
    bins: list[dict[str, str | int]] | None = None


class Manifest(_Record):
    """What a dataset says of itself when its run has ended (``manifest.json``; docs/dataset.md).

    Attributes:
        frames: how many there should be.
        failed_frames: index → error of each frame that could not be made.
        seed, renderer, plugins: of the run; a dataset of ``posse collect`` has none.
        versions: of posse-core, Python and libraries.
        sources, selection: of a dataset of ``posse collect``: what was joined, and what was left out.
        sha256: path → digest of every file but images, arrays and exports.
        exports: path → digest of every file that writers wrote in the dataset's folder.
        frame_checksums: the file with the digests of images and arrays.
    """

    format: Literal["posse-dataset"] = FORMAT
    format_version: Literal[1] = FORMAT_VERSION
    state: State
    frames: Count
    failed_frames: dict[int, str]
    seed: int | None = None
    renderer: dict[str, JsonValue] | None = None
    versions: dict[str, str] = Field(default_factory=dict)
    plugins: dict[str, PluginVersion] | None = None
    sources: list[Source] | None = None
    selection: list[Selection] | None = None
    sha256: dict[str, str]
    exports: dict[str, str] = Field(default_factory=dict)
    frame_checksums: str = CHECKSUMS

    @property
    def is_complete(self) -> bool:
        """Whether every frame was made."""
        return self.state == "complete"

    def as_json(self) -> dict[str, Any]:
        """For :func:`json.dumps`: the keys that were given when it was made or read."""
        return self.model_dump(mode="json", exclude_unset=True)

    @classmethod
    def from_json(cls, text: bytes) -> Manifest:
        """Read what :meth:`as_json` gave.

        Raises:
            InputError: it is none; the message names the first key that is at fault.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            path = ".".join(str(step) for step in first["loc"])
            raise InputError(f"{path}: {first['msg'].lower()}" if path else "not JSON") from None
