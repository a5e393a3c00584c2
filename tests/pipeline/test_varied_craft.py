"""Datasets of random, damaged craft that bend and whose materials vary are proven."""

import json

import numpy as np
import pytest
from small_run import make_small

from posse_core import Dataset


@pytest.mark.slow
@pytest.mark.parametrize("seed", [15, 24])
def test_a_random_craft_with_everything_is_proven(posse_in, tmp_path_factory, seed):
    folder = make_small(
        posse_in,
        tmp_path_factory.mktemp("varied"),
        (
            f"target={{name: family, seed: {seed}, size_m: [3, 4]}}",
            "damage={missing_parts: 2, torn_parts: 3, bent_parts: 1}",
            "variation={per: frame, materials: {'*': {brightness: [0.5, 2], roughness: [0.5, 2]}}}",
            "joints={wing_1: sun-tracking, 'wing_*_hinge_*': {law: bending, amplitude_m: 0.1,"
            " frequency_hz: 0.3}}",
            "relative={roe_m: [0, 0, 6, 0, 6, 0]}",
            "annotators=[albedo, box, mask, parts, depth, normals, keypoints, pose]",
            "renderer.seconds=0",
            "times={count: 3}",
        ),
    )
    proof = posse_in(folder, "validate", folder)
    assert proof.returncode == 0, proof.stdout
    lines = [json.loads(line) for line in Dataset(folder).label_lines]
    assert len(lines) == 3
    finishes = [np.concatenate([f["base_color"] for f in line["finishes"].values()]) for line in lines]
    assert not np.allclose(finishes[0], finishes[1])
    assert len({line["joints"]["wing_1_hinge_1"]["value"] for line in lines}) == 3
