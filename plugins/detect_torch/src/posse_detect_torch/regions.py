"""RoIAlign over a feature pyramid and non-maximum suppression as torch operations.

They export to ONNX's own operations. All shapes that depend on the data stay inside them, so the graph
around them has fixed shapes.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

BINS = 7
STRIDES = (4, 8, 16, 32)
"""Strides of the pyramid levels that regions are taken from: P2 to P5."""
_BLOCK = 512


def iou_matrix(a: Tensor, b: Tensor) -> Tensor:
    """Return the IoU (..., N, M) of boxes (..., N, 4) and (..., M, 4): left, top, right, bottom."""
    low = torch.maximum(a[..., :, None, :2], b[..., None, :, :2])
    high = torch.minimum(a[..., :, None, 2:], b[..., None, :, 2:])
    common = (high - low).clamp(min=0).prod(dim=-1)
    area_a = (a[..., 2:] - a[..., :2]).prod(dim=-1)
    area_b = (b[..., 2:] - b[..., :2]).prod(dim=-1)
    return common / (area_a[..., :, None] + area_b[..., None, :] - common).clamp(min=1e-12)


def nms(boxes: Tensor, scores: Tensor, overlap: float, most: int) -> Tensor:
    """Return the indices of the boxes that greedy non-maximum suppression keeps, best first.

    The boxes are processed in blocks of descending score. Each block first loses the boxes that overlap
    one kept before. Suppression within the block is then repeated until nothing changes, which gives the
    same result as processing its boxes one by one.

    Args:
        boxes: (M, 4) left, top, right, bottom.
        scores: (M,); boxes whose score is not above 0 are dropped.
        overlap: a box is dropped when its IoU with a better one is larger than this.
        most: largest number of boxes to keep.
    """
    order = torch.argsort(scores, descending=True, stable=True)
    order = order[scores[order] > 0]
    kept = order[:0]
    for start in range(0, len(order), _BLOCK):
        block = order[start : start + _BLOCK]
        if len(kept):
            block = block[~(iou_matrix(boxes[block], boxes[kept]) > overlap).any(dim=1)]
        covers = torch.triu(iou_matrix(boxes[block], boxes[block]) > overlap, diagonal=1)
        stays = torch.ones(len(block), dtype=torch.bool, device=boxes.device)
        while True:
            thinned = ~(covers & stays[:, None]).any(dim=0)
            if torch.equal(thinned, stays):
                break
            stays = thinned
        kept = torch.cat([kept, block[stays]])
        if len(kept) >= most:
            break
    return kept[:most]


@torch.library.custom_op("posse::nms_padded", mutates_args=())
def nms_padded(boxes: Tensor, scores: Tensor, overlap: float, most: int) -> Tensor:
    """Return (B, most) int64 indices of the boxes (B, M, 4) that :func:`nms` keeps, padded with −1."""
    out = boxes.new_full((len(boxes), most), -1, dtype=torch.int64)
    for row, one, score in zip(out, boxes, scores, strict=True):
        kept = nms(one, score, overlap, most)
        row[: len(kept)] = kept
    return out


@nms_padded.register_fake
def _(boxes: Tensor, scores: Tensor, overlap: float, most: int) -> Tensor:
    return boxes.new_empty((boxes.shape[0], most), dtype=torch.int64)


def pyramid_roi_align(levels: Sequence[Tensor], rois: Tensor, level: Tensor, sampling: int) -> Tensor:
    """Return the features of regions in 7 × 7 bins (RoIAlign, He et al. 2017).

    A bin's feature is the mean of ``sampling``² bilinear samples. All of them are computed as one
    weighted sum over the rows of a table, without a loop over pictures or levels, and with a gradient.

    Args:
        levels: P2 … P5, (B, C, H/4, W/4) … (B, C, H/32, W/32).
        rois: (B, R, 4) left, top, right, bottom in pixels.
        level: (B, R) int64 pyramid level of each region, 0 for P2.
        sampling: samples along each axis of a bin.

    Returns:
        (B, R, C, 7, 7).
    """
    batch, channels = levels[0].shape[:2]
    count, device = rois.shape[1], rois.device
    table = torch.cat([x.permute(0, 2, 3, 1).reshape(-1, channels) for x in levels])
    heights = torch.tensor([x.shape[2] for x in levels], device=device)
    widths = torch.tensor([x.shape[3] for x in levels], device=device)
    firsts = torch.cumsum(heights * widths * batch, 0) - heights * widths * batch
    height, width = heights[level], widths[level]  # (B, R)
    first = firsts[level] + torch.arange(batch, device=device)[:, None] * height * width
    scale = 1.0 / torch.tensor(STRIDES, device=device, dtype=rois.dtype)[level]
    fractions = (torch.arange(BINS * sampling, device=device, dtype=rois.dtype) + 0.5) / (
        BINS * sampling
    )
    ends = rois * scale[..., None] - 0.5
    x = ends[..., 0:1] + fractions * (ends[..., 2:3] - ends[..., 0:1])  # (B, R, 7 s)
    y = ends[..., 1:2] + fractions * (ends[..., 3:4] - ends[..., 1:2])
    column, by_column = _corners(x, width[..., None])  # (2, B, R, 7 s)
    row, by_row = _corners(y, height[..., None])
    index = first[..., None, None] + row[:, None, ..., :, None] * width[..., None, None]
    index = index + column[None, :, ..., None, :]  # (2, 2, B, R, 7 s, 7 s)
    weight = by_row[:, None, ..., :, None] * by_column[None, :, ..., None, :] / sampling**2

    def bags(values: Tensor) -> Tensor:
        split = values.reshape(2, 2, batch, count, BINS, sampling, BINS, sampling)
        return split.permute(2, 3, 4, 6, 0, 1, 5, 7).reshape(batch * count * BINS * BINS, -1)

    summed = F.embedding_bag(bags(index), table, mode="sum", per_sample_weights=bags(weight))
    return summed.reshape(batch, count, BINS, BINS, channels).permute(0, 1, 4, 2, 3)


def _corners(at: Tensor, size: Tensor) -> tuple[Tensor, Tensor]:
    """Return the two cells (2, ...) int64 that enclose a coordinate, and their linear weights (2, ...).

    The weights are 0 for coordinates more than a cell outside.
    """
    outside = (at < -1) | (at > size)
    at = torch.minimum(at.clamp(min=0), (size - 1).to(at.dtype))
    low = at.floor()
    high = torch.minimum(low + 1, (size - 1).to(at.dtype))
    part = torch.where(outside, 0.0, at - low)
    rest = torch.where(outside, 0.0, 1 - (at - low))
    return torch.stack([low, high]).long(), torch.stack([rest, part]).to(at.dtype)


@torch.library.custom_op("posse::roi_align", mutates_args=())
def roi_align(
    p2: Tensor, p3: Tensor, p4: Tensor, p5: Tensor, rois: Tensor, level: Tensor, sampling: int
) -> Tensor:
    """Compute :func:`pyramid_roi_align` as one operation, which the exporter does not look into."""
    return pyramid_roi_align((p2, p3, p4, p5), rois, level, sampling).contiguous()


@roi_align.register_fake
def _(
    p2: Tensor, p3: Tensor, p4: Tensor, p5: Tensor, rois: Tensor, level: Tensor, sampling: int
) -> Tensor:
    return p2.new_empty((rois.shape[0], rois.shape[1], p2.shape[1], BINS, BINS))
