"""The manifest of a dataset: its origin, whether it is complete, and the digests of its files."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError

from posse_core._errors import InputError

FORMAT: Final = "posse-dataset"
FORMAT_VERSION: Final = 1
CHECKSUMS: Final = "checksums.sha256"
"""The file with the digests of images and arrays, in the format of the tool ``sha256sum``."""

State = Literal["complete", "incomplete"]
Count = Annotated[int, Field(ge=0)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True)


class PluginVersion(_Record):
    """A plugin that was installed when the run ended: its distribution, version and state."""

    dist: str
    version: str
    state: str


class Source(_Record):
    """A dataset from which ``posse collect`` took frames.

    Attributes:
        dataset: name of its folder.
        scenario: path of the copy of its scenario from the folder of the manifest, where its inputs are
            beside; None if it has no scenario.
        frames, seed, renderer, versions, sources: as in its own manifest.
    """

    dataset: str
    scenario: str | None
    frames: Count
    seed: int | None = None
    renderer: dict[str, JsonValue] | None = None
    versions: dict[str, str] = Field(default_factory=dict)
    sources: list[Source] | None = None


class Selection(_Record):
    """The effect of a rule of ``posse collect``.

    Attributes:
        rule: name of the rule.
        why: the rule in words.
        dropped: number of frames that it left out.
        bins: for the rule ``balance``: the names of each bin, its number of frames, and how many were
            kept.
    """

    rule: str
    why: str
    dropped: Count
    bins: list[dict[str, str | int]] | None = None


class Manifest(_Record):
    """The manifest that a run writes when it ends (``manifest.json``; docs/dataset.md).

    Attributes:
        format, format_version: of the dataset.
        state: whether every frame was made.
        frames: number of frames that the dataset should have.
        failed_frames: index → error of each frame that could not be made.
        seed, renderer, plugins: those of the run; None in a dataset of ``posse collect``.
        versions: versions of posse-core, Python and libraries.
        sources, selection: in a dataset of ``posse collect``, the datasets that were joined, and the
            rules by which frames were left out.
        sha256: path → digest of every file but images, arrays and exports.
        exports: path → digest of every file that writers wrote into the dataset's folder.
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
        """The keys that were given when the manifest was made or read, as a mapping for
        :func:`json.dumps`."""
        return self.model_dump(mode="json", exclude_unset=True)

    @classmethod
    def from_json(cls, text: bytes) -> Manifest:
        """Read a manifest.

        Raises:
            InputError: the text is not a valid manifest; the message names the first key at fault.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            path = ".".join(str(step) for step in first["loc"])
            raise InputError(f"{path}: {first['msg'].lower()}" if path else "not JSON") from None
