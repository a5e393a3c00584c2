"""The laboratory scenarios from end to end: lit by what stands around the spacecraft, and proven."""

import numpy as np
import pytest

from posse_core import Dataset

SMALL = ("-o", "camera.scale=0.125", "-o", "writers=[]", "-o", "annotators=[box,mask,keypoints,pose]")


def made(posse_in, folder, scenario, *options):
    given = ("--renderer", "raster", "--frames", 3, "--out", "d")
    done = posse_in(folder, "run", scenario, *given, *SMALL, *options)
    assert done.returncode == 0, done.stderr
    proof = posse_in(folder, "validate", "d")
    assert proof.returncode == 0, proof.stdout
    return Dataset(folder / "d")


def craft_and_room(dataset):
    """Mean DN of the spacecraft and of what is far from it, over the frames that show it."""
    means = []
    for i, line in enumerate(dataset):
        if line.mask_area_px > 50:
            image, mask = dataset.image(i).astype(float), dataset.mask(i)
            x, y, width, height = line.box_visible_px
            near = np.zeros_like(mask)
            near[max(0, y - 20) : y + height + 20, max(0, x - 20) : x + width + 20] = True
            means.append((image[mask].mean(), image[~near].mean() if (~near).any() else np.nan))
    return np.array(means)


def test_light_boxes_light_the_spacecraft_before_a_black_wall(posse_in, tmp_path):
    pytest.importorskip("posse_render_raster")
    black = ("-o", "sky.laboratory.wall_w_m2_sr=[0,0]")
    means = craft_and_room(made(posse_in, tmp_path, "tango-lightbox", *black))
    assert len(means) >= 2
    assert (means[:, 0] > 13.0).all()
    np.testing.assert_allclose(means[:, 1][np.isfinite(means[:, 1])], 12.0, atol=0.6)  # the offset


def test_the_lamp_lights_the_spacecraft_and_the_room(posse_in, tmp_path):
    pytest.importorskip("posse_render_raster")
    dataset = made(posse_in, tmp_path, "tango-sunlamp")
    assert all(line.sun_fraction_target == 1 for line in dataset)
    means = craft_and_room(dataset)
    assert (means[:, 0] > 14.0).all()
    assert np.nanmedian(means[:, 1]) > 13.0
    exposures_s = np.array([line.exposure_s for line in dataset])
    assert (exposures_s >= 0.002).all()
    assert len(set(exposures_s)) == len(exposures_s)
