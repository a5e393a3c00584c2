"""Several bodies in an image, one of them with a wing that moves: each export in the programs that read
it, and against the closed forms that the images were made by.

COCO is read by pycocotools. BOP's toolkit is in no package registry: its counts are made anew here by
its definitions (``calc_gt_info.py``), from the files alone and the blocks' slabs.
"""

import json
import shutil

import company
import cuboid
import cv2
import numpy as np
import pycocotools.coco
import pycocotools.cocoeval
import pycocotools.mask
import pytest
import trimesh
import yaml
from command import run_posse

from posse_core._dataset.dataset import Dataset
from posse_core._errors import InputError
from posse_core._evaluation.exports import check_exports
from posse_core._formats.bop import BopWriter
from posse_core._formats.coco import CocoWriter
from posse_core._formats.colmap import ColmapWriter
from posse_core._formats.nerfstudio import NerfstudioWriter
from posse_core._formats.opening import open_dataset
from posse_core._formats.speed import SpeedWriter
from posse_core._formats.yolo import YoloWriter
from posse_core._plugins.options import NoOptions

# pycocotools' own, with numpy 2
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

IMAGES = company.images()
OBJECTS = ("winged", "winged-wing", "plate", "winged")
"""Of BOP: the target's body and wing, the plate, and the twin, whose wing does not move."""
SCENE = "bop/train/000000"


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = company.write_dataset(tmp_path_factory.mktemp("company") / "d")
    for writer in (BopWriter, CocoWriter, SpeedWriter, YoloWriter):
        writer(NoOptions()).write(Dataset(folder), folder)
    return folder


@pytest.fixture
def folder(exported, tmp_path):
    return shutil.copytree(exported, tmp_path / "d")


def members():
    """Frame, number of the body, and the body."""
    return [(i, k, m) for i, image in enumerate(IMAGES) for k, m in enumerate(image.members)]


def test_coco_has_an_annotation_of_each_body_that_is_seen(exported):
    coco = pycocotools.coco.COCO(str(exported / "coco.json"))
    names = {category["id"]: category for category in coco.loadCats(coco.getCatIds())}
    found = {}
    for annotation in coco.loadAnns(coco.getAnnIds()):
        number = [None, *company.NAMES].index(annotation.get("instance"))
        image, frame = IMAGES[annotation["image_id"]], annotation["image_id"]
        mask = image.body == number
        assert np.array_equal(coco.annToMask(annotation) > 0, mask)
        assert annotation["area"] == mask.sum() == pycocotools.mask.area(annotation["segmentation"])
        assert annotation["bbox"] == pycocotools.mask.toBbox(annotation["segmentation"]).tolist()
        assert annotation["iscrowd"] == 0
        category = names[annotation["category_id"]]
        assert category["name"] == image.members[number].name
        assert len(annotation["keypoints"]) == 3 * len(category["keypoints"])
        true = image.labels(number)["keypoints"]
        points = zip(*[iter(annotation["keypoints"])] * 3, strict=True)
        for name, point in zip(category["keypoints"], points, strict=True):
            assert list(point) == pytest.approx(true[name] if true[name][2] else [0, 0, 0], abs=1e-9)
        found[frame, number] = annotation
    assert found.keys() == {(i, k) for i, k, _ in members() if (IMAGES[i].body == k).any()}
    assert {(company.HIDDEN_TARGET, 0), (company.HIDDEN_PLATE, 1)}.isdisjoint(found)


@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_the_truth_scores_full_marks_and_swapped_masks_do_not(exported, kind):
    coco = pycocotools.coco.COCO(str(exported / "coco.json"))
    for swapped in (False, True):
        results = [{**a, "score": 1.0} for a in coco.loadAnns(coco.getAnnIds())]
        for result in results:
            result["category_id"] = 3 - result["category_id"] if swapped else result["category_id"]
        evaluation = pycocotools.cocoeval.COCOeval(coco, coco.loadRes(results), kind)
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
        assert evaluation.stats[0] < 0.1 if swapped else evaluation.stats[0] == pytest.approx(1)


def test_coco_read_back_has_every_body_under_its_name(exported):
    coco, source = open_dataset(exported / "coco.json"), Dataset(exported)
    for ours, theirs in zip(coco, source, strict=True):
        seen = {k: b for k, b in theirs.instances.items() if b.box_visible_px is not None}
        assert {k for k, b in ours.instances.items() if b.box_visible_px is not None} == seen.keys()
        for name, body in seen.items():
            mine = ours.instances[name]
            assert (mine.spacecraft, mine.box_visible_px) == (body.spacecraft, body.box_visible_px)
            assert mine.mask_rle == body.mask_rle
            assert list(mine.keypoints) == list(body.keypoints)


def test_coco_of_another_origin_names_bodies_by_their_ids(folder):
    path = folder / "coco.json"
    value = json.loads(path.read_text())
    for annotation in value["annotations"]:
        annotation.pop("instance", None)
    path.write_text(json.dumps(value))
    ids = [a["id"] for a in value["annotations"] if a["image_id"] == 0]
    line = open_dataset(path)[0]
    assert list(line.instances) == [None, *map(str, ids[1:])]


@pytest.fixture(scope="module")
def scene(exported):
    names = ("scene_camera", "scene_gt", "scene_gt_info")
    return [json.loads((exported / SCENE / f"{name}.json").read_text()) for name in names]


@pytest.fixture(scope="module")
def models(exported):
    infos = json.loads((exported / "bop/models/models_info.json").read_text())
    assert [infos[str(i)]["name"] for i in range(1, 5)] == list(OBJECTS)
    return {
        i: trimesh.load(exported / f"bop/models/obj_{i:06d}.ply", process=False) for i in range(1, 5)
    }


def objects(member, number):
    """The blocks of each rigid object of a body."""
    blocks = member.blocks()
    return [[block] for block in blocks] if number == 0 else [blocks]


def test_bop_puts_each_object_where_its_blocks_are(scene, models):
    _, poses, _ = scene
    for index, image in enumerate(IMAGES):
        wanted = [o for k, m in enumerate(image.members) for o in objects(m, k)]
        entries = poses[str(index)]
        assert [entry["obj_id"] for entry in entries] == [1, 2, 3, 4]
        for entry, blocks in zip(entries, wanted, strict=True):
            R = np.reshape(entry["cam_R_m2c"], (3, 3))
            x_mm = models[entry["obj_id"]].vertices @ R.T + entry["cam_t_m2c"]
            corners = np.concatenate([cuboid.corners(half) @ R.T + t for R, t, half in blocks]) * 1e3
            # Every corner of the blocks is a vertex of the model, and every vertex a corner.
            apart = np.linalg.norm(x_mm[:, None] - corners[None], axis=-1)
            assert apart.min(axis=0).max() < 0.02  # float32, tens of metres away
            assert apart.min(axis=1).max() < 0.02


def test_bop_counts_are_those_of_its_toolkit_s_definitions(exported, scene):
    cameras, _, infos = scene
    v, u = np.mgrid[: company.CAMERA.height_px, : company.CAMERA.width_px].astype(float)
    for index, image in enumerate(IMAGES):
        steps = cv2.imread(str(exported / SCENE / f"depth/{index:06d}.png"), cv2.IMREAD_UNCHANGED)
        scale_mm = cameras[str(index)]["depth_scale"]
        depth_mm = steps * scale_mm
        true_mm = np.where(np.isfinite(image.depth), image.depth, 0) * 1e3
        assert np.abs(depth_mm - true_mm).max() <= 0.51 * scale_mm
        wanted = [o for k, m in enumerate(image.members) for o in objects(m, k)]
        for number, (blocks, info) in enumerate(zip(wanted, infos[str(index)], strict=True)):
            own = np.min([company.slabs(*block, u, v)[0] for block in blocks], axis=0)
            mask, visible = (
                cv2.imread(
                    str(exported / SCENE / f"{kind}/{index:06d}_{number:06d}.png"), cv2.IMREAD_UNCHANGED
                )
                == 255
                for kind in ("mask", "mask_visib")
            )
            assert np.array_equal(mask, np.isfinite(own))
            # An object is visible where the image is not nearer than it; here, within a depth step.
            near = np.isfinite(own) & (np.where(np.isfinite(own), own, 0) * 1e3 <= depth_mm + scale_mm)
            assert np.array_equal(visible, near)
            covered = set()
            for block in blocks:
                (u0, v0), (u1, v1) = company.window(*block)
                rows, columns = np.mgrid[v0 : v1 + 1, u0 : u1 + 1]
                hit = np.isfinite(company.slabs(*block, columns, rows)[0])
                covered |= set(zip(columns[hit].tolist(), rows[hit].tolist(), strict=True))
            assert info["px_count_all"] == len(covered)
            assert info["px_count_valid"] == mask.sum()
            assert info["px_count_visib"] == visible.sum()
            assert info["visib_fract"] == (visible.sum() / len(covered) if covered else 0)
            columns, rows = np.array(sorted(covered)).T
            x, y, width, height = info["bbox_obj"]
            if mask.any() and not (mask[[0, -1]].any() or mask[:, [0, -1]].any()):
                assert (x, y) == (columns.min(), rows.min())
                assert (x + width, y + height) == (columns.max(), rows.max())
            # Beyond the image, ours is of the pixels within the projected vertices.
            assert (x, y) <= (columns.min(), rows.min())
            assert x + width - columns.max() in (0, 1)
            assert y + height - rows.max() in (0, 1)
            if visible.any():
                rows, columns = np.nonzero(visible)
                x, y, width, height = info["bbox_visib"]
                assert (x, y) == (columns.min(), rows.min())
                assert (x + width, y + height) == (columns.max(), rows.max())
            else:
                assert info["bbox_visib"] == [-1, -1, -1, -1]


def test_yolo_has_a_row_of_each_body_that_is_seen(exported):
    data = yaml.safe_load((exported / "yolo/data.yaml").read_text())
    assert data["names"] == {0: "plate", 1: "winged"}
    count, _ = data["kpt_shape"]
    for index, image in enumerate(IMAGES):
        rows = (exported / f"yolo/labels/{index:06d}.txt").read_text().splitlines()
        seen = [image.labels(k) for k in range(3) if (image.body == k).any()]
        assert len(rows) == len(seen)
        for row, labels in zip(rows, seen, strict=True):
            class_, cx, cy, width, height, *points = map(float, row.split())
            assert data["names"][int(class_)] == labels["spacecraft"]
            box = [160 * (cx - width / 2), 120 * (cy - height / 2), 160 * width, 120 * height]
            assert box == pytest.approx(labels["box_visible_px"])
            assert len(points) == 3 * count
            shown = np.reshape(points, (-1, 3))[:, 2].tolist()
            visibility = [point[2] for point in labels["keypoints"].values()]
            assert shown == visibility + [0] * (count - len(visibility))


def test_speed_has_the_target_alone(exported):
    poses = json.loads((exported / "speed.json").read_text())
    for pose, image in zip(poses, IMAGES, strict=True):
        assert pose["r_Vo2To_vbs_true"] == image.members[0].t.tolist()


def test_each_export_passes_its_check_and_those_of_another_origin(exported):
    for result in check_exports(Dataset(exported)):
        assert (result.name, result.checked, result.faults) == (result.name, len(IMAGES), [])
    for name in ("coco.json", "bop", "yolo"):
        code, out, error = run_posse("validate", exported / name)
        assert code == 0, out + error


def test_thinned_by_rules_on_the_target_the_exports_are_of_all_bodies(exported, tmp_path):
    """Frames in which the target is hidden are dropped, whatever else they show."""
    out = tmp_path / "thinned"
    code, _, error = run_posse("collect", exported, "--out", out, "--drop", "few-keypoints")
    assert code == 0, error
    dataset = Dataset(out)
    left = [line.origin[1] for line in dataset]
    assert left
    assert {company.HIDDEN_TARGET, company.TARGET_OUT}.isdisjoint(left)
    for writer in (BopWriter, CocoWriter, YoloWriter):
        writer(NoOptions()).write(dataset, out)
    for result in check_exports(dataset):
        assert (result.name, result.checked, result.faults) == (result.name, len(left), [])
    coco = json.loads((out / "coco.json").read_text())
    seen = sum((IMAGES[index].body == k).any() for index in left for k in range(3))
    assert len(coco["annotations"]) == seen


def faults(folder, name):
    (result,) = (r for r in check_exports(Dataset(folder)) if r.name == f"{name} export")
    return [(fault.frame, fault.message) for fault in result.faults]


def alter(path, change):
    value = json.loads(path.read_text())
    change(value)
    path.write_text(json.dumps(value))


def test_two_instances_swapped_in_coco_are_found(folder):
    def swap(value):
        one, other = (a for a in value["annotations"] if a["image_id"] == 0 and "instance" in a)
        one["bbox"], other["bbox"] = other["bbox"], one["bbox"]

    alter(folder / "coco.json", swap)
    assert {message.partition(":")[0] for _, message in faults(folder, "coco")} == set(company.NAMES)


def test_a_body_left_out_of_coco_is_found(folder):
    def drop(value):
        value["annotations"] = [
            a for a in value["annotations"] if (a["image_id"], a.get("instance")) != (0, "twin")
        ]

    alter(folder / "coco.json", drop)
    assert faults(folder, "coco") == [(0, "it has 2 bodies of this image, the label line has 3")]


def test_an_instance_of_another_name_in_coco_is_found(folder):
    def rename(value):
        for annotation in value["annotations"]:
            if annotation.get("instance") == "twin":
                annotation["instance"] = "other"

    alter(folder / "coco.json", rename)
    assert {message for _, message in faults(folder, "coco")} == {"it has a body 'other', not 'twin'"}


def test_a_wing_at_the_angle_of_another_frame_in_bop_is_found(folder):
    def change(value):
        value["0"][1] = value["5"][1]

    alter(folder / f"{SCENE}/scene_gt.json", change)
    assert [message[:10] for _, message in faults(folder, "bop")] == ["object 1: "] * 2


def test_occlusion_ignored_in_bop_is_found(folder):
    scene = folder / SCENE
    shutil.copy(scene / "mask/000000_000000.png", scene / "mask_visib/000000_000000.png")
    assert faults(folder, "bop") == [(0, "mask is not the dataset's")]


def test_rows_of_yolo_in_another_order_are_found(folder):
    path = folder / "yolo/labels/000000.txt"
    path.write_text("".join(reversed(path.read_text().splitlines(keepends=True))))
    assert {frame for frame, _ in faults(folder, "yolo")} == {0}


@pytest.mark.parametrize(
    ("writer", "name"), [(ColmapWriter, "COLMAP"), (NerfstudioWriter, "nerfstudio")]
)
def test_a_static_world_has_no_moving_joints(writer, name, exported, tmp_path):
    with pytest.raises(InputError, match=rf"{name} supports rigid .* 'winged' move \(wing\)"):
        writer(NoOptions()).write(Dataset(exported), tmp_path)


def test_a_static_world_shows_no_points_behind_other_bodies(tmp_path):
    folder = company.write_dataset(tmp_path / "d", moving=False)
    ColmapWriter(NoOptions()).write(Dataset(folder), folder)
    lines = (folder / "colmap/winged/sparse/0/images.txt").read_text().splitlines()
    images = company.images(moving=False)
    observed = 0
    for pose, points in zip(lines[::2], lines[1::2], strict=True):
        image = images[int(pose.split()[0]) - 1]
        uv = np.reshape(points.split(), (-1, 3))[:, :2].astype(float) - 0.5
        column, row = np.rint(uv).astype(int).T
        assert (image.body[row, column] == 0).all()
        observed += len(uv)
    assert observed > 1000
    assert all(not result.faults for result in check_exports(Dataset(folder)))
