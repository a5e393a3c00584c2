"""A backbone from an ImageNet checkpoint tells what that net told of grey pictures."""

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from safetensors.torch import save_file

from posse_core import InputError, ModelCard
from posse_detect_torch.imagenet import load_imagenet
from posse_detect_torch.sdn import Backbone

BLOCKS = {18: (2, 2, 2, 2), 50: (3, 4, 6, 3)}


def checkpoint(depth):
    """Random tensors under the names and shapes that torchvision's ResNets have."""
    random = torch.Generator().manual_seed(depth)
    tensors = {}

    def conv(name, outward, inward, side):
        scale = (2 / (inward * side**2)) ** 0.5
        tensors[f"{name}.weight"] = scale * torch.randn(outward, inward, side, side, generator=random)

    def norm(name, width):
        for key in ("weight", "running_var"):
            tensors[f"{name}.{key}"] = 0.01 + torch.rand(width, generator=random)
        for key in ("bias", "running_mean"):
            tensors[f"{name}.{key}"] = 0.1 * torch.randn(width, generator=random)
        tensors[f"{name}.num_batches_tracked"] = torch.tensor(7)

    conv("conv1", 64, 3, 7)
    norm("bn1", 64)
    inward = 64
    for stage, count in enumerate(BLOCKS[depth]):
        width = 64 * 2**stage
        outward = width * (4 if depth == 50 else 1)
        sides = ((width, 1), (width, 3), (outward, 1)) if depth == 50 else ((width, 3), (width, 3))
        for place in range(count):
            base, before = f"layer{stage + 1}.{place}", inward
            for number, (after, side) in enumerate(sides, 1):
                conv(f"{base}.conv{number}", after, before, side)
                norm(f"{base}.bn{number}", after)
                before = after
            if inward != outward:
                conv(f"{base}.downsample.0", outward, inward, 1)
                norm(f"{base}.downsample.1", outward)
            inward = outward
    tensors["fc.weight"], tensors["fc.bias"] = torch.zeros(1000, inward), torch.zeros(1000)
    return tensors


def stages_of_resnet18(tensors, colours):
    """He et al. 2015 as torchvision has it, by its names: pictures (B, 3, S, S) → the four stages."""

    def norm(x, name):
        values = [tensors[f"{name}.{k}"] for k in ("running_mean", "running_var", "weight", "bias")]
        return F.batch_norm(x, *values, eps=1e-5)

    def conv(x, name, stride, padding):
        return F.conv2d(x, tensors[f"{name}.weight"], stride=stride, padding=padding)

    x = F.max_pool2d(F.relu(norm(conv(colours, "conv1", 2, 3), "bn1")), 3, 2, 1)
    stages = []
    for stage in range(4):
        for place in range(2):
            base, stride = f"layer{stage + 1}.{place}", 2 if stage > 0 and place == 0 else 1
            y = F.relu(norm(conv(x, f"{base}.conv1", stride, 1), f"{base}.bn1"))
            y = norm(conv(y, f"{base}.conv2", 1, 1), f"{base}.bn2")
            if f"{base}.downsample.0.weight" in tensors:
                x = norm(conv(x, f"{base}.downsample.0", stride, 0), f"{base}.downsample.1")
            x = F.relu(x + y)
        stages.append(x)
    return stages


@torch.no_grad()
def test_it_tells_what_the_net_told_of_grey_pictures(tmp_path):
    tensors = checkpoint(18)
    save_file(tensors, tmp_path / "r18.safetensors")
    backbone = Backbone(18).eval()
    load_imagenet(backbone, tmp_path / "r18.safetensors")
    light = torch.rand(2, 1, 96, 96, generator=torch.Generator().manual_seed(1)) - 0.3
    colours = light / torch.tensor([0.229, 0.224, 0.225])[:, None, None]
    x = backbone.stem(255 * light)
    for stage, expected in zip(backbone.stages, stages_of_resnet18(tensors, colours), strict=True):
        x = stage(x)
        np.testing.assert_allclose(x, expected, rtol=1e-4, atol=1e-4 * float(expected.abs().max()))


@torch.no_grad()
def test_every_weight_of_resnet50_has_its_place(tmp_path):
    tensors = checkpoint(50)
    save_file(tensors, tmp_path / "r50.safetensors")
    backbone = Backbone(50)
    before = {name: value.clone() for name, value in backbone.state_dict().items()}
    load_imagenet(backbone, tmp_path / "r50.safetensors")
    after = backbone.state_dict()
    for name, value in after.items():
        is_pyramid = name.startswith(("lateral", "smooth"))
        counts = name.endswith("num_batches_tracked")
        assert torch.equal(value, before[name]) == (is_pyramid or counts), name
    last = backbone.stages[3][2].body[6]
    assert torch.equal(last.weight, tensors["layer4.2.conv3.weight"])
    assert torch.equal(last.bias, torch.zeros(2048))


def test_other_files_are_refused_in_one_line(tmp_path):
    tensors = checkpoint(18)

    def refused(match, content, depth=18, name="x.safetensors"):
        if isinstance(content, bytes):
            (tmp_path / name).write_bytes(content)
        else:
            save_file(content, tmp_path / name)
        with pytest.raises(InputError, match=match) as caught:
            load_imagenet(Backbone(depth), tmp_path / name)
        assert "\n" not in str(caught.value)

    refused("not a safetensors file; nothing is loaded by pickle: python -c", b"PK", name="x.pth")
    refused("not a safetensors file$", b"junk")
    refused("has no 'conv1.weight'", {"stem.weight": torch.zeros(1)})
    refused("three input colours", {**tensors, "conv1.weight": torch.zeros(64, 1, 7, 7)})
    refused("set the option depth", tensors, depth=50)


def test_training_starts_there_and_the_model_tells_so(posse, make_dataset, tmp_path):
    save_file(checkpoint(18), tmp_path / "r18.safetensors")
    data = make_dataset(tmp_path / "d", 4)
    assert posse("partition", data, "--split", "1/0/0")[0] == 0
    arguments = ("train", data, "--detector", "sdn", "--out", tmp_path / "o")
    small = ("-o", "input_px=64", "-o", "epochs=1", "-o", "batch=8", "-o", "learning_rate=1e-12")
    weights = ("-o", f"backbone_weights={tmp_path / 'r18.safetensors'}")
    code, _, error = posse(*arguments, *small, *weights)
    assert code == 0, error
    model = tmp_path / "o" / "model.safetensors"
    told = ModelCard.read(model).options["backbone_weights"]
    assert told.startswith("r18.safetensors, SHA-256 ")
    assert str(tmp_path).encode() not in model.read_bytes()
    from safetensors.torch import load_file

    mine = load_file(model)["backbone.stages.0.1.body.3.weight"]
    torch.testing.assert_close(mine, checkpoint(18)["layer1.1.conv2.weight"], atol=1e-5, rtol=0)
    carried_on = ("--detector", "sdn", "--out", tmp_path / "next", *small, "-o", f"start={model}")
    code, _, error = posse("train", data, *carried_on)
    assert code == 0, error
    for trained in (model, tmp_path / "next" / "model.safetensors"):
        code, _, error = posse("detect", data / "images" / "000000.png", "--model", trained)
        assert code == 0, error
    code, _, error = posse(*arguments, *small, "-o", "backbone_weights=none.safetensors")
    assert code == 2
    assert "backbone_weights" in error
