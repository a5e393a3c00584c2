"""From chance to a detector, by the commands that a user types; interrupted, repeated, exported."""

import json
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest
import torch
from safetensors.torch import load_file

from posse_core import Dataset, LabelLine, ModelCard, Square
from posse_detect_torch.checkpoint import write_model
from posse_detect_torch.heatmap_finder import HeatmapLesson
from posse_detect_torch.learn import CURVES, LAST, MODEL, computes_in_bfloat16, learn
from posse_detect_torch.nano_detector import NanoLesson
from posse_detect_torch.options import HeatmapOptions, NanoOptions, SdnOptions, TrainOptions
from posse_detect_torch.pictures import Cut, cut_backgrounds, cut_pictures
from posse_detect_torch.sdn_detector import SdnLesson

SETTINGS = ("-o", "input_px=64", "-o", "batch=8", "-o", "learning_rate=0.003", "-o", "augment=false")


def mean_ap50(posse, dataset: Dataset, model: Path) -> float:
    code, out, error = posse("eval", dataset.folder, "--model", model, "--part", "all", "--json")
    assert code == 0, error
    return json.loads(out)["groups"][0]["metrics"]["mAP50"]


@pytest.fixture(scope="session")
def trained(posse, dataset, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("trained")
    arguments = ("train", dataset.folder, "--detector", "nano", "--out", out, *SETTINGS)
    code, told, error = posse(*arguments, "-o", "epochs=10")
    assert code == 0, error
    assert told.strip() == str(out / MODEL)
    return out / MODEL


@pytest.fixture(scope="session")
def exported(posse, dataset, trained) -> Path:
    path = trained.with_name("nano.onnx")
    code, out, error = posse("export-onnx", trained, "--dataset", dataset.folder, "--out", path)
    assert code == 0, error
    assert "boxes, px" in out
    return path


@pytest.mark.slow
def test_it_learns(make_dataset, posse, dataset, trained, tmp_path):
    """On frames that it never saw, of the same two crafts."""
    fresh = Dataset(make_dataset(tmp_path / "fresh", 40, seed=6))
    options = NanoOptions(epochs=1, input_px=64, learning_rate=1e-9)
    lesson, card = a_lesson(dataset, tmp_path, options)
    (tmp_path / "untrained").mkdir()
    untrained = learn(lesson, card, tmp_path / "untrained")
    assert mean_ap50(posse, fresh, untrained) < 0.1
    assert mean_ap50(posse, fresh, trained) > 0.5
    assert "<polyline" in trained.with_name(CURVES).read_text()


def test_the_model_tells_what_it_learned_from(dataset, trained):
    card = ModelCard.read(trained)
    assert card.classes == ("brick", "plate")
    assert card.epochs == 10
    assert list(card.keypoints_body_m["brick"]) == ["B1", "B2", "B3", "B4", "T1", "T2", "T3", "T4"]
    assert (
        card.dataset_sha256
        == ModelCard.of_dataset(dataset, net="", task="", input_px=0, version="").dataset_sha256
    )


def a_lesson(dataset, folder, options, kind=NanoLesson):
    """What makes the lesson, and its card."""
    card = ModelCard.of_dataset(
        dataset,
        net="nano",
        task="boxes",
        input_px=options.input_px,
        version="0",
        options=options.model_dump(mode="json"),
    )
    folder.mkdir(exist_ok=True)
    return partial(kind, dataset, folder, card.classes, options), card


class StoppedLesson(NanoLesson):
    """Ends in its second epoch, when a checkpoint is there."""

    def __init__(self, dataset, folder, classes, options):
        super().__init__(dataset, folder, classes, options)
        self._last = folder / LAST

    def judge(self, net):
        if self._last.exists():
            raise KeyboardInterrupt
        return super().judge(net)


def test_a_training_cut_short_ends_as_if_it_had_not_been(make_dataset, tmp_path):
    small = Dataset(make_dataset(tmp_path / "d", 20))
    options = NanoOptions(epochs=3, input_px=64, batch=8, threads=1)
    weights = []
    for cut in (False, True):
        folder = tmp_path / str(cut)
        if cut:
            with pytest.raises(KeyboardInterrupt):
                learn(*a_lesson(small, folder, options, StoppedLesson), folder)
            assert not (folder / MODEL).exists()
        weights.append(learn(*a_lesson(small, folder, options), folder).read_bytes())
    assert weights[0] == weights[1]


def test_masks_are_cut_as_pictures_are(dataset, tmp_path):
    """The two crafts are brighter than the sky."""
    square = Square.around(np.array([20.0, 30.0, 60.0, 40.0]), 96)  # not the whole image, enlarged
    cuts = [Cut(i, dataset[i], square) for i in range(8)]
    pictures = cut_pictures(dataset, cuts, 96, tmp_path, "some", masks=True)
    for position in range(8):
        light, covered = pictures.linear(position), pictures.coverage(position)
        between = 0.5 * (8 + 60) / 255
        assert np.mean((light > between) != (covered > 0.5)) < 0.03
    assert {0.0, 1.0} <= set(np.unique(pictures.coverage(0)).tolist())
    assert cut_pictures(dataset, cuts, 96, tmp_path, "some").covered is None
    assert len(cut_backgrounds(dataset, 96, tmp_path)) == 0  # each frame shows a craft


def test_a_frame_without_masks_keeps_its_background(dataset, tmp_path):
    class SomeMasked(Dataset):
        def __getitem__(self, i):
            labels = super().__getitem__(i)
            return labels if i != 1 else LabelLine(**{k: v for k, v in labels if k != "mask_rle"})

    square = Square.around(np.array([20.0, 30.0, 60.0, 40.0]), 96)
    cuts = [Cut(i, dataset[i], square) for i in range(3)]
    whole = cut_pictures(dataset, cuts, 96, tmp_path, "whole", masks=True)
    some = cut_pictures(SomeMasked(dataset.folder), cuts, 96, tmp_path, "some", masks=True)
    for position in (0, 2):
        assert np.array_equal(some.coverage(position), whole.coverage(position))
    assert np.all(some.coverage(1) == 1)


def test_bfloat16_is_the_default_where_the_processor_says_that_it_multiplies_it():
    flags = set(Path("/proc/cpuinfo").read_text(encoding="ascii").split())
    assert computes_in_bfloat16(NanoOptions()) is bool(flags & {"amx_tile", "avx512_bf16"})
    assert computes_in_bfloat16(NanoOptions(precision="bfloat16"))
    assert not computes_in_bfloat16(NanoOptions(precision="float32"))


@pytest.mark.parametrize(
    ("kind", "its_options"),
    [(NanoLesson, NanoOptions), (HeatmapLesson, HeatmapOptions), (SdnLesson, SdnOptions)],
)
def test_bfloat16_changes_losses_by_its_rounding_alone(kind, its_options, dataset, tmp_path):
    """Its significands have 8 bits: each number is wrong by 0.4 % at most."""
    options: TrainOptions = its_options(input_px=64, batch=4, augment=False)
    card = ModelCard.of_dataset(dataset, net="", task="", input_px=64, version="0")
    given = card if kind is HeatmapLesson else card.classes
    lesson = kind(dataset, tmp_path, given, options)
    lesson.net.train()
    samples = [lesson.sample(i, np.random.default_rng(i)) for i in range(4)]
    batch = {key: torch.from_numpy(np.stack([s[key] for s in samples])) for key in samples[0]}
    told = []
    for enabled in (False, True):
        with torch.autocast("cpu", torch.bfloat16, enabled=enabled):
            losses = lesson.losses(batch)
        assert all(loss.dtype == torch.float32 for loss in losses.values())
        # those of SDN's regions are of others, as soon as two proposals change their order
        stable = torch.stack([loss for name, loss in losses.items() if name not in ("class", "box")])
        lesson.net.zero_grad()
        stable.sum().backward()
        gradient = torch.cat([p.grad.flatten() for p in lesson.net.parameters() if p.grad is not None])
        told.append((stable.detach(), gradient))
    (exact, slope), (rounded, rounded_slope) = told
    assert not torch.equal(exact, rounded)
    torch.testing.assert_close(rounded, exact, rtol=0.05, atol=0.01)
    assert torch.cosine_similarity(slope, rounded_slope, dim=0) > 0.9  # of weights before any training


@pytest.mark.parametrize("detector", ["nano", "heatmap", "sdn"])
def test_a_training_that_cannot_begin_leaves_nothing_behind(detector, dataset, posse, tmp_path):
    strange = tmp_path / "strange.safetensors"
    write_model(strange, {"weight": torch.zeros(3)}, ModelCard("nano", "boxes", ("a",), 64, "", "", "0"))
    out = tmp_path / "out"
    arguments = ("train", dataset.folder, "--detector", detector, "--out", out, "-o", "input_px=64")
    code, _, error = posse(*arguments, "-o", f"start={strange}")
    assert code == 2
    assert "none of its tensors fits this network" in error
    assert not list(out.glob("*"))


def test_the_state_of_a_training_starts_another_from_its_average(trained, dataset, posse, tmp_path):
    """A rate of next to nothing leaves the weights where they began."""
    out = tmp_path / "out"
    arguments = ("train", dataset.folder, "--detector", "nano", "--out", out, "-o", "input_px=64")
    more = ("-o", "epochs=1", "-o", "learning_rate=1e-12", "-o", f"start={trained.parent / LAST}")
    code, _, error = posse(*arguments, *more)
    assert code == 0, error
    began, ended = load_file(trained), load_file(out / MODEL)
    weights = [name for name in began if name.endswith("weight")]
    assert weights
    for name in weights:
        torch.testing.assert_close(ended[name], began[name], rtol=1e-5, atol=1e-6)


def test_a_folder_of_another_training_stays_as_it_was(trained, dataset, posse):
    before = {path.name: path.read_bytes() for path in trained.parent.iterdir()}
    arguments = ("train", dataset.folder, "--detector", "nano", "--out", trained.parent)
    code, _, error = posse(*arguments, "-o", "input_px=128")
    assert code == 2
    assert "holds a training with other options" in error
    assert {path.name: path.read_bytes() for path in trained.parent.iterdir()} == before


def test_onnx_is_made_of_standard_operations_and_tells_nothing_of_this_machine(exported):
    model = onnx.load(exported)
    assert {entry.domain for entry in model.opset_import} == {""}
    assert model.opset_import[0].version == 18
    assert not model.functions
    assert "NonMaxSuppression" not in {node.op_type for node in model.graph.node}
    assert b"site-packages" not in exported.read_bytes()
    assert str(Path(__file__).parents[3]).encode() not in exported.read_bytes()


def test_onnx_finds_what_torch_finds_without_torch(posse, dataset, trained, exported):
    frames = [str(dataset.folder / dataset[i].image) for i in range(6)]
    found = []
    for model in (trained, exported):
        code, out, error = posse("detect", *frames, "--model", model, "--score", 0.2, "--json")
        assert code == 0, error
        found.append(json.loads(out))
    assert sum(len(row["detections"]) for row in found[0]) >= 4
    for a, b in zip(*found, strict=True):
        assert len(a["detections"]) == len(b["detections"])
        for x, y in zip(a["detections"], b["detections"], strict=True):
            assert x["label"] == y["label"]
            assert x["score"] == pytest.approx(y["score"], abs=2e-4)
            np.testing.assert_allclose(x["box_px"], y["box_px"], atol=0.1)
    code = (
        "import sys\n"
        "from importlib.metadata import entry_points\n"
        "(posse,) = entry_points(group='console_scripts', name='posse')\n"
        "try:\n"
        f"    posse.load()(['detect', {frames[0]!r}, '--model', {str(exported)!r}])\n"
        "except SystemExit as ended:\n"
        "    print(ended.code, 'torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.splitlines()[-1] == "0 False", done.stdout + done.stderr


@pytest.mark.slow
def test_eight_bits_find_the_same_with_standard_operations(posse, dataset, trained, tmp_path):
    small = tmp_path / "int8.onnx"
    arguments = ("export-onnx", trained, "--dataset", dataset.folder, "--out", small, "--int8")
    code, out, error = posse(*arguments)
    assert code == 0, error
    told = re.search(r"calibrated on (\d+) frames; on (\d+) others: .*mAP50 ([\d.]+) to ([\d.]+)", out)
    assert told, out
    assert abs(int(told[1]) - int(told[2])) <= 1
    before, after = float(told[3]), float(told[4])
    assert after == pytest.approx(mean_ap50(posse, dataset, small), abs=0.1)
    assert after > before - 0.1
    model = onnx.load(small)
    assert {entry.domain for entry in model.opset_import} == {""}
    weights = {value.name: value.data_type for value in model.graph.initializer}
    assert {node.domain for node in model.graph.node} == {""}
    first, *others = [node for node in model.graph.node if node.op_type == "Conv"]
    assert weights[first.input[1]] == onnx.TensorProto.FLOAT
    for node in others:
        (source,) = [n for n in model.graph.node if node.input[1] in n.output]
        assert source.op_type == "DequantizeLinear"
        assert weights[source.input[0]] == onnx.TensorProto.INT8
    assert read_onnx_card(small) == ModelCard.read(trained)


def read_onnx_card(path):
    metadata = {entry.key: entry.value for entry in onnx.load(path).metadata_props}
    return ModelCard.from_metadata(metadata, path)


def test_a_batch_gives_what_each_picture_gives(exported):
    import onnxruntime

    session = onnxruntime.InferenceSession(str(exported))
    pictures = np.random.default_rng(0).uniform(0, 1, (3, 1, 64, 64)).astype(np.float32)
    whole = session.run(["raw"], {"picture": pictures})[0]
    for i in range(3):
        one = session.run(["raw"], {"picture": pictures[i : i + 1]})[0]
        np.testing.assert_allclose(whole[i], one[0], atol=1e-4)


def test_results_are_drawn(posse, dataset, exported, tmp_path):
    code, _, error = posse(
        "detect",
        dataset.folder / "images",
        "--model",
        exported,
        "--out",
        tmp_path / "o",
        "--score",
        0.05,
    )
    assert code == 0, error
    drawn = cv2.imread(str(tmp_path / "o" / "000002.png"))
    assert drawn.shape == (120, 160, 3)
    assert (np.ptp(drawn.astype(int), axis=2) > 50).any()  # colour on a grey image


def test_bad_input_is_told_in_one_line(posse, dataset, trained, exported, tmp_path):
    def refused(words, *arguments):
        code, _, error = posse(*arguments)
        assert code == 2, (arguments, error)
        assert "\n" not in error.strip()
        for word in words:
            assert word in error, (word, error)

    image = dataset.folder / dataset[0].image
    junk = tmp_path / "junk.onnx"
    junk.write_bytes(b"not a model")
    (tmp_path / "junk.png").write_bytes(b"not an image")
    (tmp_path / "empty").mkdir()
    bare = onnx.load(exported)
    del bare.metadata_props[:]
    onnx.save(bare, tmp_path / "bare.onnx")
    refused(["junk.onnx", "ONNX"], "detect", image, "--model", junk)
    refused(["bare.onnx", "metadata"], "detect", image, "--model", tmp_path / "bare.onnx")
    refused(["junk.png", "not an image"], "detect", tmp_path / "junk.png", "--model", exported)
    refused(["no images"], "detect", tmp_path / "empty", "--model", exported)
    refused(["no such file"], "detect", image, "--model", tmp_path / "none.safetensors")
    refused(["not a safetensors"], "detect", image, "--model", tmp_path / "junk.png")
    refused(
        ["finds boxes", "finds keypoints"], "detect", image, "--model", exported, "--keypoints", trained
    )
    refused(["--camera", "--keypoints"], "detect", image, "--model", exported, "--camera", image)
    refused(["threds", "threads"], "detect", image, "--model", exported, "-o", "threds=2")
    refused(["no part 'tset'"], "eval", dataset.folder, "--model", exported, "--part", "tset")
    refused(["'nano2'", "nano"], "train", dataset.folder, "--detector", "nano2", "--out", tmp_path / "o")
    refused(
        ["cannot be trained"], "train", dataset.folder, "--detector", "onnx", "--out", tmp_path / "o"
    )
    refused(
        ["input_px"],
        "train",
        dataset.folder,
        "--detector",
        "nano",
        "--out",
        tmp_path,
        "-o",
        "input_px=7",
    )
    refused(["other options"], "train", dataset.folder, "--detector", "nano", "--out", trained.parent)
    refused([".onnx"], "export-onnx", trained, "--dataset", dataset.folder, "--out", tmp_path / "x.bin")
    refused(
        ["two images are named"],
        *("detect", image, image, "--model", exported, "--out", tmp_path / "drawn"),
    )
    (dataset_less := tmp_path / "undivided").mkdir()
    refused(["not a dataset"], "eval", dataset_less, "--model", exported)


def test_parts_may_be_empty_but_not_the_train_part(make_dataset, posse, tmp_path):
    folder = make_dataset(tmp_path / "d", 10)
    arguments = ("train", folder, "--detector", "nano", "-o", "input_px=64", "-o", "epochs=1", "--out")
    assert posse("partition", folder, "--split", "0/1/1")[0] == 0
    code, _, error = posse(*arguments, tmp_path / "a")
    assert code == 2
    assert "no frame of the train part shows a spacecraft" in error
    assert posse("partition", folder, "--split", "1/0/0")[0] == 0
    code, _, error = posse(*arguments, tmp_path / "b")
    assert code == 0, error


def test_coco_is_learned_from_and_measured_on(make_dataset, posse, tmp_path):
    folder = make_dataset(tmp_path / "d", 10)
    coco = tmp_path / "coco"
    shutil.copytree(folder / "images", coco / "images")
    assert posse("export", folder, "--format", "coco", "--out", coco)[0] == 0
    (coco / "coco.json").rename(coco / "train.json")
    arguments = ("train", coco, "-o", "input_px=64", "-o", "epochs=1", "--out")
    code, out, error = posse(*arguments, tmp_path / "o", "--detector", "nano")
    assert code == 0, error
    assert ModelCard.read(Path(out.strip())).classes == ("brick", "plate")
    whole = coco / "train.json"
    code, out, error = posse("eval", whole, "--model", out.strip(), "--part", "all", "--json")
    assert code == 0, error
    assert json.loads(out)["groups"][0]["frames"] == 10
    code, _, error = posse(*arguments, tmp_path / "k", "--detector", "heatmap")
    assert code == 2
    assert "spacecraft/NAME.json" in error


def test_a_checkpoint_of_another_net_and_unknown_classes_are_refused(
    make_dataset, posse, trained, tmp_path
):
    from posse_detect_torch.checkpoint import write_model

    card = ModelCard.read(trained)
    write_model(tmp_path / "other.safetensors", {"weight": torch.zeros(3)}, card)
    strange = Dataset(make_dataset(tmp_path / "d", 10, names=("brick", "disc")))
    image = strange.folder / strange[0].image
    code, _, error = posse("detect", image, "--model", tmp_path / "other.safetensors")
    assert code == 2
    assert "do not fit this network" in error
    code, _, error = posse("eval", strange.folder, "--model", trained, "--part", "all")
    assert code == 2
    assert "does not know disc" in error
