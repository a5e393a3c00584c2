"""The common interface of POSSE and COCO datasets: labelled images of spacecraft."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path

from posse_core._arrays import AnyArray, BoolArray
from posse_core._dataset.files import read_image
from posse_core._dataset.layout import inside, mesh_file
from posse_core._dataset.mesh import Mesh, read_mesh
from posse_core._dataset.spacecraft import SpacecraftInfo
from posse_core._errors import InputError
from posse_core._model.camera import Camera
from posse_core._model.label_line import LabelLine


class LabelledImages(Sequence[LabelLine]):
    """Images of spacecraft, with their labels: a sequence of label lines.

    In all methods a position ``i`` counts the images from 0, or from the end if it is negative. The
    index of a frame, ``images[i].index``, differs from its position if frames are missing. The index
    occurs in the names of the frame's files and is the frame's row in the trajectory. :meth:`position`
    converts an index to the position.

    Attributes:
        folder: the folder of the files.
        spacecraft_by_name: all spacecraft in the dataset by name.
    """

    folder: Path
    spacecraft_by_name: Mapping[str, SpacecraftInfo]

    def __init__(self) -> None:
        self._meshes: dict[str, Mesh] = {}

    @property
    @abstractmethod
    def camera(self) -> Camera:
        """The camera's intrinsics.

        Raises:
            InputError: There is no file of intrinsics.
        """

    @abstractmethod
    def part(self, name: str) -> list[int]:
        """Return the positions of the frames in a part (``train``, ``valid``, ``test``), ascending.

        Raises:
            InputError: The dataset has no parts, or none of this name.
        """

    @abstractmethod
    def position(self, index: int) -> int:
        """Return the position of the frame with this index.

        Raises:
            InputError: There is no such frame.
        """

    @abstractmethod
    def size_px(self, i: int) -> tuple[int, int]:
        """Return the height and width of the image that a frame's labels refer to."""

    @property
    @abstractmethod
    def sha256(self) -> str:
        """Hexadecimal SHA-256 of the dataset's content.

        Raises:
            InputError: The run has not ended, or a file cannot be read.
        """

    @property
    def scenario_sha256(self) -> str:
        """Hexadecimal SHA-256 of the scenario; empty if there is none."""
        return ""

    @property
    def classes(self) -> Mapping[str, SpacecraftInfo]:
        """All spacecraft that the labels speak of, by name: the targets', and those of the bodies beside
        them.

        Bodies of one name may differ in shape, as fragments do; then it is one of them.

        Raises:
            InputError: Bodies of one name have keypoints of other names.
        """
        return self.spacecraft_by_name

    def loose_keypoints(self, name: str) -> list[str]:
        """Names of those keypoints of a class that have no place of their own in body axes: joints carry
        them, or they are elsewhere on another body of the class."""
        return sorted(self.classes[name].keypoint_joints)

    @property
    def spacecraft(self) -> SpacecraftInfo:
        """The only spacecraft of the dataset.

        Raises:
            InputError: There are several; use :attr:`spacecraft_by_name`.
        """
        if len(self.spacecraft_by_name) > 1:
            names = ", ".join(self.spacecraft_by_name)
            raise InputError(f"{self.folder}: has several spacecraft ({names}), but one is needed")
        return next(iter(self.spacecraft_by_name.values()))

    def image(self, i: int) -> AnyArray:
        """Return the image of a frame: (H, W) or (H, W, 3) red-green-blue, uint8 or uint16.

        Raises:
            IndexError: There is no such position.
            InputError: The file is missing, damaged, or of another size.
        """
        path = inside(self.folder, self[i].image)
        image = read_image(path)
        found, wanted = image.shape[:2], self.size_px(i)
        if found != wanted:
            raise InputError(
                f"{path}: is {found[1]} × {found[0]} pixels, but its labels are for"
                f" {wanted[1]} × {wanted[0]}"
            )
        return image

    def mask(self, i: int) -> BoolArray:
        """Return the mask (H, W) bool of the pixels whose centre is on the spacecraft.

        Raises:
            IndexError: There is no such position.
            InputError: The labels have no mask, or it is damaged.
        """
        labels = self[i]
        try:
            return labels.mask_rle.mask()
        except ValueError as error:
            raise InputError(f"{self.folder}: frame {labels.index}: {error}") from None

    def mesh(self, name: str | None = None) -> Mesh:
        """Return the mesh of a spacecraft, or of the only one if the name is None.

        Raises:
            InputError: There is no such spacecraft, or its file is missing or damaged.
        """
        name = self.spacecraft.name if name is None else name
        if name not in self.spacecraft_by_name:
            known = ", ".join(self.spacecraft_by_name)
            raise InputError(f"{self.folder}: has no spacecraft {name!r}; it has {known}")
        if name not in self._meshes:
            self._meshes[name] = read_mesh(mesh_file(self.folder, name))
        return self._meshes[name]
