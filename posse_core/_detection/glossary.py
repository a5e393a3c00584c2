"""What the columns of ``posse eval`` mean. It imports nothing, so that the command's help is quick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

POSES: Final = "poses estimated"
"""Name of the first metric of poses."""

_OF_ONE: Final = "AP.NAME"

METRICS: Final[Mapping[str, str]] = {
    "mAP": "COCO's average precision, the mean over overlaps of 0.5 to 0.95 and over the classes; 1 is"
    " best",
    "mAP50": "mAP at an overlap of 0.5 alone",
    "mAP75": "mAP at an overlap of 0.75 alone",
    "mAR": "COCO's average recall with up to 100 detections in an image; 1 is best",
    "AR50": "its greatest term, the recall at an overlap of 0.5; the thesis' mAR",
    _OF_ONE: "mAP of the spacecraft NAME",
    "box IoU mean": "overlap (area of the intersection over that of the union) of each spacecraft's box"
    " with the best detection of its class, 0 without one: the mean",
    "box IoU median": "the same overlap: the median",
    POSES: "share of the visible spacecraft whose best detection had the right class and gave a pose,"
    " however wrong",
    "ADD < 0.1 d": "share of the visible spacecraft with a correct pose, one whose ADD is below a tenth"
    " of the diameter; ADD is the mean distance of the mesh's vertices from where they are",
    "ADI < 0.1 d": "the same by ADI, whose distances are to the nearest vertex, so that symmetries do"
    " not count",
    "ADD median, d": "median ADD of the estimated poses, in diameters",
    "ADI median, d": "median ADI of the estimated poses, in diameters",
    "e_t before": "e_t median of the poses before refinement",
    "e_q before, deg": "e_q median of the poses before refinement",
    "refined": "share of the poses whose refinement was accepted; the others stay as they were",
    "worsened": "share of the accepted poses with a larger e_t + e_q (radians) than before",
    "e_t median": "position error divided by the range, median of the estimated poses",
    "e_q median, deg": "attitude error to the nearest of the spacecraft's symmetries, median of the"
    " estimated poses",
    "e_t 90th percentile": "position error divided by the range that a tenth of the estimated poses"
    " exceeds",
    "e_q 90th percentile, deg": "attitude error that a tenth of the estimated poses exceeds",
    "NEES median": "squared error in standard deviations of the estimated poses, by their own covariance"
    " (six degrees of freedom): the median, 5.35 if the covariances are right, more if too small",
    "in 95 % region": "share of the estimated poses whose error is inside the ellipsoid that their"
    " covariance says holds 95 %",
    "right": "share of the estimated poses that are right: the position within 5 % of the range and the"
    " attitude within 5°; a pose of what is no spacecraft is wrong",
    "trust mean": "mean of the trusts of the estimated poses, the probabilities of being right that"
    " their covariances give; equal to the share that is right if those are honest",
    "trust AUC": "share of the pairs of a right and a wrong pose in which the right one has more trust"
    " (area under the receiver operating characteristic); 0.5 is chance and 1 best",
    "trusted": "share of the estimated poses whose trust is at least 0.5",
    "right if trusted": "share of these that are right",
    "SPEED 2019": "mean of e_t + e_q (radians) of the estimated poses; 0 is best",
    "SPEED 2021": "the same, 0 where both errors are below the floors of SPEED+ (0.002173 and 0.169°)",
    "SPEED 2023": "the same, each error 0 where it is below its floor",
}
"""Column → its meaning, in the order of the tables."""


def meanings(columns: Sequence[str]) -> list[tuple[str, str]]:
    """The meaning of each of some columns, beside its name."""
    of_one = _OF_ONE.removesuffix("NAME")
    return [
        (
            name,
            METRICS[name]
            if name in METRICS
            else METRICS[_OF_ONE].replace("NAME", name.removeprefix(of_one)),
        )
        for name in columns
    ]
