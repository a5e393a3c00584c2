"""Labels and arrays of a frame, by the annotators of a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from posse_core._arrays import AnyArray
from posse_core._environment.time import Epoch
from posse_core._errors import ComponentError
from posse_core._interfaces.annotator import Annotator
from posse_core._interfaces.look import Look
from posse_core._model.label_line import FinishLabels, LabelLine, ReadingLabels, first_fault
from posse_core._model.labels import Labels
from posse_core._plugins.registry import Registry
from posse_core._scenario.component import ComponentChoice, create
from posse_core._simulator.returned import checked_labels, full_size


class Annotation:
    """Asks every annotator for its labels of a frame, and puts them together.

    What the core's annotators make are labels of the line itself; what another annotator makes stands
    under the annotator's own name.
    """

    def __init__(self, choices: Sequence[ComponentChoice], registry: Registry, epoch: Epoch) -> None:
        """epoch: of t_s = 0.

        Raises:
            ComponentError: an annotator cannot be made, or has the name of a label of the core.
        """
        self._epoch = epoch
        self._annotators: Mapping[str, Annotator[Any]] = {
            choice.name: create(registry, "annotator", choice) for choice in choices
        }
        self._core = {name for name in self._annotators if registry.is_core("annotator", name)}
        for name in self._annotators.keys() & LabelLine.model_fields.keys():
            if name not in self._core:
                raise ComponentError(f"annotator {name!r}: a label of POSSE's own has this name")

    def labels(self, look: Look) -> Labels:
        """The labels of a look, those of plugins' annotators under the annotators' names, those of the
        bodies beside the target by the bodies' names, and full-size arrays (H, W, ...).

        Raises:
            ComponentError: an annotator makes what cannot be written, or an array that another made too.
        """
        labels, arrays = self._of_body(look)
        if look.scene.others:
            labels["bodies"] = {
                body.name: {
                    "spacecraft": body.spacecraft.name,
                    **self._of_body(look.about(number))[0],
                }
                for number, body in enumerate(look.scene.others, 1)
            }
        return Labels(labels, arrays)

    def _of_body(self, look: Look) -> tuple[dict[str, Any], dict[str, AnyArray]]:
        """Labels of the body that a look is about, and full-size arrays of all bodies."""
        labels: dict[str, Any] = {}
        arrays: dict[str, AnyArray] = {}
        view = look.view()
        for name, annotator in self._annotators.items():
            own = checked_labels(annotator.annotate(look), name, view)
            if name in self._core:
                labels.update(own.values)
            elif own.values:
                labels[name] = own.values
            for array_name, array in own.arrays.items():
                if array_name in arrays:
                    raise ComponentError(f"two annotators make the array {array_name!r}; choose one")
                arrays[array_name] = full_size(array, view, look.scene.camera)
        return labels, arrays

    def line(
        self,
        look: Look,
        labels: Labels,
        exposure_s: float,
        sensors: Mapping[str, tuple[ReadingLabels, ...]],
    ) -> LabelLine:
        """The label line of a frame.

        Args:
            look: of the chaser's camera.
            labels: of the look.
            exposure_s: of the image.
            sensors: labels of the sensors' readings.

        Raises:
            ComponentError: a label is not of its type or range.
        """
        frame = look.state
        beside: dict[str, Any] = {"sensors": dict(sensors)} if sensors else {}
        if frame.craft.finishes:
            beside["finishes"] = {
                name: FinishLabels(
                    base_color=finish.base_color, roughness=finish.roughness, pattern=finish.pattern
                )
                for name, finish in frame.craft.finishes.items()
            }
        try:
            return LabelLine(
                index=frame.index,
                t_s=frame.t_s,
                epoch_utc=self._epoch.shifted(frame.t_s).iso(),
                sequence=frame.sequence,
                spacecraft=look.scene.spacecraft.name,
                sun_fraction_target=frame.sun_fraction_target,
                sun_fraction_camera=frame.sun_fraction_camera,
                solar_flux_w_m2=frame.solar_flux_w_m2,
                exposure_s=exposure_s,
                **labels.values,
                **beside,
            )
        except ValidationError as error:
            raise ComponentError(f"a label cannot be written: {first_fault(error)}") from None
