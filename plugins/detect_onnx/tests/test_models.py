"""ONNX files written by hand: what their graphs tell arrives in the image's pixels."""

import json
import shutil

import cuboid
import cv2
import numpy as np
import onnx
import pytest
from command import run_posse
from onnx import TensorProto, helper, numpy_helper
from scipy.spatial.transform import Rotation

import posse_core as posse
from posse_core import Camera, Dataset, Detection, InputError, ModelCard, Square, preset_camera
from posse_core._detection.models import open_models
from posse_core._plugins.loading import load_plugins
from posse_core._plugins.registry import Registry
from posse_detect_onnx.models import OnnxDetector, OnnxKeypoints
from posse_detect_onnx.options import OnnxOptions

CORNERS = {"A1": [0.0, 0, 0], "A2": [1.0, 0, 0]}


def write_model(path, task, outputs, plate=CORNERS):
    """A graph that always tells ``outputs``, whatever it sees of 64 × 64 pixels."""
    card = ModelCard(
        net="by-hand",
        task=task,
        classes=("brick", "plate"),
        input_px=64,
        dataset_sha256="",
        scenario_sha256="",
        version="0",
        keypoints_body_m={"brick": {"B1": [0.0, 0, 1]}, "plate": plate},
    )
    nodes, values = [], []
    for name, array in outputs.items():
        nodes.append(helper.make_node("Constant", [], [name], value=numpy_helper.from_array(array)))
        kind = helper.np_dtype_to_tensor_dtype(array.dtype)
        values.append(helper.make_tensor_value_info(name, kind, array.shape))
    picture = helper.make_tensor_value_info("picture", TensorProto.FLOAT, ("B", 1, 64, 64))
    model = helper.make_model(
        helper.make_graph(nodes, "g", [picture], values),
        opset_imports=[helper.make_opsetid("", 18)],
        ir_version=9,
    )
    for key, value in card.metadata().items():
        model.metadata_props.add(key=key, value=value)
    onnx.save(model, path)
    return path


def boxes_model(path):
    return write_model(
        path,
        "boxes",
        {
            # the second is padding, the third reaches over the image's left and lower border
            "boxes": np.array([[[16, 24, 8, 4], [1, 1, 5, 5], [-4, 40, 20, 30]]], np.float32),
            "scores": np.array([[0.5, 0.9, 0.8]], np.float32),
            "labels": np.array([[1, -1, 0]], np.int64),
        },
    )


def test_boxes_come_back_in_the_image_best_first(tmp_path):
    detector = OnnxDetector(OnnxOptions())
    detector.load(boxes_model(tmp_path / "m.onnx"))
    assert tuple(detector.classes) == ("brick", "plate")
    (found,) = detector.predict([np.zeros((96, 128), np.uint8)])  # padded by 16 rows, halved
    assert [(d.label, pytest.approx(d.score)) for d in found] == [("brick", 0.8), ("plate", 0.5)]
    np.testing.assert_allclose(found[1].box_px, [32, 32, 16, 8])
    np.testing.assert_allclose(found[0].box_px, [0, 64, 32, 32])


def test_keypoints_are_those_of_the_class_in_the_image(tmp_path):
    first = np.array([[1, 1], [31.5, 31.5], [0, 63]], np.float32)
    second = np.array([[3, 3], [0, 63], [31.5, 31.5]], np.float32)
    outputs = {
        "points": np.stack([first, second], axis=1)[None],
        "sigma": np.array([[[1, 9], [2, 4], [3, 6]]], np.float32),
        "share": np.array([[[1, 0], [0.75, 0.25], [0.5, 0.25]]], np.float32),
    }
    path = write_model(tmp_path / "k.onnx", "keypoints", outputs)
    finder = OnnxKeypoints(OnnxOptions())
    finder.load(path)
    np.testing.assert_allclose(finder.keypoints_body_m["plate"], list(CORNERS.values()))
    image = np.zeros((300, 300), np.uint8)
    box = Detection("plate", 1.0, np.array([50.0, 60, 100, 40]))  # its square: 130 px about (100, 80)
    (found,) = finder.find(image, [box])
    middle, corner = found.keypoints_px
    np.testing.assert_allclose(middle, [99.5, 79.5], atol=1e-4)
    np.testing.assert_allclose(
        corner, [35 - 0.5 + 0.5 * 130 / 64, 145 - 0.5 - 0.5 * 130 / 64], atol=1e-4
    )
    np.testing.assert_allclose(found.keypoints_sigma_px, np.array([2, 3]) * 130 / 64)
    np.testing.assert_allclose(found.places.points_px, [[middle, corner], [corner, middle]])
    np.testing.assert_allclose(found.places.sigma_px, np.array([[2, 4], [3, 6]]) * 130 / 64)
    np.testing.assert_array_equal(found.places.share, [[0.75, 0.25], [0.5, 0.25]])


def test_a_network_that_knows_one_place_of_each_keypoint_tells_no_others(tmp_path):
    points = np.array([[[1, 1], [31.5, 31.5], [0, 63]]], np.float32)
    outputs = {"points": points, "sigma": np.array([[1, 2, 3]], np.float32)}
    finder = OnnxKeypoints(OnnxOptions())
    finder.load(write_model(tmp_path / "k.onnx", "keypoints", outputs))
    box = Detection("plate", 1.0, np.array([50.0, 60, 100, 40]))
    (found,) = finder.find(np.zeros((300, 300), np.uint8), [box])
    assert found.places is None
    np.testing.assert_allclose(found.keypoints_px[0], [99.5, 79.5], atol=1e-4)
    np.testing.assert_allclose(found.keypoints_sigma_px, np.array([2, 3]) * 130 / 64)


def test_a_model_for_another_task_is_refused(tmp_path):
    with pytest.raises(InputError, match="finds boxes, but one that finds keypoints"):
        OnnxKeypoints(OnnxOptions()).load(boxes_model(tmp_path / "m.onnx"))


def broken_by(path, change):
    model = onnx.load(boxes_model(path))
    change(model)
    path.write_bytes(model.SerializeToString())


def newer_format(model):
    model.ir_version = 99


def strange_operation(model):
    model.graph.node[0].op_type = "Guess"


def constant_of_no_kind(model):
    model.graph.node[0].attribute[0].type = 0


@pytest.mark.parametrize(
    ("write", "reason"),
    [
        (lambda path: path.write_text("boxes"), "Protobuf parsing failed"),
        (lambda path: broken_by(path, newer_format), "Unsupported model IR version: 99"),
        (lambda path: broken_by(path, strange_operation), r"[^/]*Guess"),
        (lambda path: broken_by(path, constant_of_no_kind), r"[^/\[]*attribute"),
    ],
    ids=["text", "newer", "operation", "kind"],
)
def test_a_file_that_cannot_be_run_is_told_with_the_reason_alone(write, reason, tmp_path):
    path = tmp_path / "m.onnx"
    write(path)
    with pytest.raises(InputError, match=rf"m\.onnx: not an ONNX [a-z ]*: {reason}") as told:
        OnnxDetector(OnnxOptions()).load(path)
    assert "\n" not in str(told.value)


def test_a_graph_for_no_picture_is_refused(tmp_path):
    def change(model):
        model.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 0

    broken_by(tmp_path / "m.onnx", change)
    with pytest.raises(InputError, match=r"takes {'picture': \[0, 1, 64, 64\]}, but POSSE gives"):
        OnnxDetector(OnnxOptions()).load(tmp_path / "m.onnx")


def test_the_shipped_nets_are_taken_where_none_is_named(tmp_path):
    registry = load_plugins().registry
    detector, finder = open_models(None, None, registry, {})
    assert finder is not None
    assert tuple(detector.classes) == tuple(finder.classes) == ("aqua", "cluster")
    detector, finder = open_models(None, None, registry, {}, ["tango"])
    assert finder is not None
    assert tuple(detector.classes) == tuple(finder.classes) == ("tango",)
    for in_flight, classes in ((False, ("aqua",)), (True, ("aqua", "cluster"))):
        detector, finder = open_models(None, None, registry, {}, ["aqua"], in_flight=in_flight)
        assert finder is not None
        assert tuple(detector.classes) == tuple(finder.classes) == classes
    for wanted, told in ((["cubesat"], "cubesat"), (["tango", "aqua"], "aqua and tango")):
        with pytest.raises(InputError, match=f"no shipped model finds {told}; there are models of aqua"):
            open_models(None, None, registry, {}, wanted)
    detector, finder = open_models(boxes_model(tmp_path / "m.onnx"), None, registry, {})
    assert tuple(detector.classes) == ("brick", "plate")
    assert finder is None
    with pytest.raises(InputError, match="pip install posse-detect-onnx"):
        open_models(None, None, Registry(), {})


def test_from_image_to_pose_by_the_command(tmp_path):
    """Constant nets that tell the box and the keypoints of a known pose."""
    camera = Camera(300, 300, 400.0, 400.0, 149.5, 149.5, 0.01)
    points = np.random.default_rng(2).uniform(-1, 1, (8, 3))
    attitude = Rotation.from_rotvec([0.3, -0.5, 0.8])
    t = np.array([0.2, -0.1, 9.0])
    pixels = camera.project(attitude.apply(points) + t)
    box = np.concatenate([pixels.min(axis=0), np.ptp(pixels, axis=0)])
    outputs = {
        "boxes": Square.of_image(300, 300, 64).boxes_in(box)[None, None].astype(np.float32),
        "scores": np.array([[0.9]], np.float32),
        "labels": np.array([[1]], np.int64),
    }
    write_model(tmp_path / "m.onnx", "boxes", outputs)
    told = np.concatenate([[[0.0, 0]], Square.around(box, 64).points_in(pixels)])[None]
    outputs = {"points": told.astype(np.float32), "sigma": np.ones((1, 9), np.float32)}
    plate = {f"P{i}": x.tolist() for i, x in enumerate(points)}
    write_model(tmp_path / "k.onnx", "keypoints", outputs, plate)
    intrinsics = {"Nu": 300, "Nv": 300, "ppx": 5e-6, "cameraMatrix": camera.matrix.tolist()}
    (tmp_path / "camera.json").write_text(json.dumps(intrinsics))
    cv2.imwrite(str(tmp_path / "image.png"), np.zeros((300, 300), np.uint8))

    names = {"--model": "m.onnx", "--keypoints": "k.onnx", "--camera": "camera.json"}
    options = [text for name, file in names.items() for text in (name, str(tmp_path / file))]
    code, out, error = run_posse("detect", tmp_path / "image.png", *options, "--json")
    assert code == 0, error
    (found,) = json.loads(out)[0]["detections"]
    assert found["label"] == "plate"
    np.testing.assert_allclose(found["pose"]["t_body_cam_m"], t, atol=1e-3)
    q = found["pose"]["q_cam_from_body"]
    turn = Rotation.from_quat([*q[1:], q[0]]) * attitude.inv()
    assert turn.magnitude() < 1e-3
    assert np.linalg.eigvalsh(found["pose"]["covariance"]).min() > 0
    _, words, _ = run_posse("detect", tmp_path / "image.png", *options)
    assert f"{np.linalg.norm(t):.2f} m away" in words
    # What was found before an image that cannot be read is not lost.
    (tmp_path / "no image.png").write_bytes(b"PNG")
    both = tmp_path / "image.png", tmp_path / "no image.png"
    code, told, error = run_posse("detect", *both, *options, "--json")
    assert (code, json.loads(told)) == (2, json.loads(out)), error
    assert "no image.png" in error
    _, words, _ = run_posse("detect", tmp_path / "image.png", *options, "--target", "brick")
    assert words == f"{tmp_path / 'image.png'}: nothing\n"
    for name in ("a.png", "b.png", "c.png"):
        shutil.copy(tmp_path / "image.png", tmp_path / name)
    several = [tmp_path / name for name in ("c.png", "a.png", "b.png")]
    told = [
        run_posse("detect", *several, *options, "--workers", count, "--out", tmp_path / f"drawn {count}")
        for count in (1, 2)
    ]
    assert told[0][:2] == told[1][:2]
    for file in (tmp_path / "drawn 1").iterdir():
        assert file.read_bytes() == (tmp_path / "drawn 2" / file.name).read_bytes()
    (tmp_path / "a.png").write_bytes(b"no image")
    code, _, error = run_posse("detect", *several, *options, "--workers", 2, "--out", tmp_path / "none")
    assert code == 2
    assert "a.png: not an image" in error
    assert not (tmp_path / "none").exists()
    code, _, error = run_posse("detect", tmp_path / "image.png", *options, "--target", "tango")
    assert code == 2
    assert "target tango: the model knows brick, plate" in error
    image, files = np.zeros((300, 300), np.uint8), (tmp_path / "m.onnx", tmp_path / "k.onnx")
    for target, labels in ((None, ["plate"]), ("plate", ["plate"]), ("brick", [])):
        detector = posse.detector(*files, target=target)
        assert [each.detection.label for each in detector.sightings(image, camera)] == labels
        assert [each.label for each in detector.detect(image)] == labels
    with pytest.raises(InputError, match="target tango: the model knows brick, plate"):
        posse.detector(*files, target="tango")


def test_a_published_camera_is_taken_by_its_name(tmp_path):
    """SPEED+'s lens moves this point by three pixels from where a pinhole has it."""
    camera = preset_camera("speed-plus")
    points = np.random.default_rng(2).uniform(-1, 1, (8, 3))
    attitude, t = Rotation.from_rotvec([0.3, -0.5, 0.8]), np.array([1.6, -0.9, 9.0])
    pixels = camera.project(attitude.apply(points) + t)
    box = np.concatenate([pixels.min(axis=0), np.ptp(pixels, axis=0)])
    outputs = {
        "boxes": Square.of_image(1200, 1920, 64).boxes_in(box)[None, None].astype(np.float32),
        "scores": np.array([[0.9]], np.float32),
        "labels": np.array([[1]], np.int64),
    }
    write_model(tmp_path / "m.onnx", "boxes", outputs)
    told = np.concatenate([[[0.0, 0]], Square.around(box, 64).points_in(pixels)])[None]
    outputs = {"points": told.astype(np.float32), "sigma": np.ones((1, 9), np.float32)}
    plate = {f"P{i}": x.tolist() for i, x in enumerate(points)}
    write_model(tmp_path / "k.onnx", "keypoints", outputs, plate)
    cv2.imwrite(str(tmp_path / "image.png"), np.zeros((1200, 1920), np.uint8))
    models = ("--model", tmp_path / "m.onnx", "--keypoints", tmp_path / "k.onnx")
    arguments = ("detect", tmp_path / "image.png", *models, "--camera")
    code, out, error = run_posse(*arguments, "speed-plus", "--json")
    assert code == 0, error
    (found,) = json.loads(out)[0]["detections"]
    np.testing.assert_allclose(found["pose"]["t_body_cam_m"], t, atol=2e-3)
    code, _, error = run_posse(*arguments, "speed-pls")
    assert code == 2
    assert (
        "--camera speed-pls: is neither a file nor a published camera; did you mean 'speed-plus'"
        in error
    )


def test_a_page_of_an_evaluation_by_the_command(tmp_path):
    """A net that tells the box of the dataset's first frame, whatever it sees."""
    dataset = Dataset(cuboid.write_dataset(tmp_path / "d"))
    box = np.array(dataset[0].box_visible_px, float)
    outputs = {
        "boxes": Square.of_image(120, 160, 64).boxes_in(box)[None, None].astype(np.float32),
        "scores": np.array([[0.9]], np.float32),
        "labels": np.array([[0]], np.int64),
    }
    write_model(tmp_path / "m.onnx", "boxes", outputs)
    arguments = ("eval", dataset.folder, "--model", tmp_path / "m.onnx", "--part", "all", "--out")
    code, out, error = run_posse(*arguments, tmp_path / "page.html")
    assert code == 0, error
    page = (tmp_path / "page.html").read_text()
    assert "m.onnx on d, part all" in page
    assert f"SHA-256: {dataset.sha256}" in page
    (found,) = [line.split() for line in out.splitlines() if line.startswith("all")]
    assert found[1] == "6"
    assert (
        page.count("<figure>") == 6
    )  # five frames that show the craft, and the false alarm in the other
    code, by_two, error = run_posse(*arguments, tmp_path / "two.html", "--workers", 2)
    assert code == 0, error
    assert by_two == out
    assert (tmp_path / "two.html").read_text() == page
    code, _, error = run_posse(*arguments, tmp_path / "none" / "page.html")
    assert code == 2
    assert "its folder does not exist" in error


def card_with(path, **changes):
    """The keypoint model with another card, in which ``None`` removes a key."""
    points = {"points": np.zeros((1, 3, 2), np.float32), "sigma": np.ones((1, 3), np.float32)}
    model = onnx.load(write_model(path, "keypoints", points))
    (entry,) = model.metadata_props
    value = {**json.loads(entry.value), **changes}
    entry.value = json.dumps({key: x for key, x in value.items() if x is not None})
    onnx.save(model, path)
    return path


BRICK = {"B1": [0.0, 0, 1]}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"classes": None}, "classes: field required"),
        ({"classes": "brick"}, "classes: "),
        ({"classes": []}, "classes: "),
        ({"classes": ["brick", "brick"]}, "given twice"),
        ({"input_px": 0}, "input_px: "),
        ({"input_px": 10**9}, "input_px: "),
        ({"input_px": "64"}, "input_px: "),
        ({"input_px": 32}, r"takes .*64.*, but POSSE gives it .*32"),
        ({"keypoints_body_m": {"brick": BRICK}}, "has no keypoints of 'plate'"),
        ({"keypoints_body_m": {"brick": BRICK, "plate": [1, 2]}}, r"keypoints_body_m\.plate: "),
        ({"keypoints_body_m": {"brick": BRICK, "plate": {"A1": [1, 2]}}}, r"plate\.A1: "),
        ({"keypoints_body_m": {"brick": {"B1": [0, 0, None]}, "plate": {}}}, r"brick\.B1\.2: "),
        ({"keypoints_body_m": {"brick": {}, "plate": {}}}, "has no keypoints, or more than 1000"),
        ({"symmetries": {"brick": 3}}, r"symmetries\.brick: "),
        ({"options": [1]}, "options: "),
        ({"epochs": -1}, "epochs: "),
        ({"format": 2}, "another version"),
        ({"format": None}, "format: missing"),
        ({"surprise": 1}, None),
    ],
)
def test_a_card_of_another_shape_is_told_by_its_key(changes, words, tmp_path):
    path = card_with(tmp_path / "k.onnx", **changes)
    finder = OnnxKeypoints(OnnxOptions())
    if words is None:  # a later version may add a key
        finder.load(path)
        return
    with pytest.raises(InputError, match=words) as told:
        finder.load(path)
    assert "k.onnx" in str(told.value)
    assert "\n" not in str(told.value)


def test_a_card_that_is_nested_without_end_is_refused(tmp_path):
    path = boxes_model(tmp_path / "m.onnx")
    model = onnx.load(path)
    model.metadata_props[0].value = '{"format": 1, "options": ' + "[" * 10_000 + "]" * 10_000 + "}"
    onnx.save(model, path)
    with pytest.raises(InputError, match=r"m\.onnx: its POSSE metadata cannot be read"):
        OnnxDetector(OnnxOptions()).load(path)


def test_a_graph_without_the_outputs_of_its_task_is_refused(tmp_path):
    path = write_model(tmp_path / "m.onnx", "boxes", {"boxes": np.zeros((1, 1, 4), np.float32)})
    with pytest.raises(InputError, match=r"m\.onnx: does not give labels, scores"):
        OnnxDetector(OnnxOptions()).load(path)
