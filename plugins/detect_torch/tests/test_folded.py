"""A network is carried on from its ONNX file as from its own weights."""

from __future__ import annotations

import copy

import onnx
import pytest
import torch
from torch import nn

from posse_core import InputError, ModelCard
from posse_detect_torch.checkpoint import read_like
from posse_detect_torch.folded import measure_norms
from posse_detect_torch.heatmap import HeatMaps
from posse_detect_torch.learn import MODEL
from posse_detect_torch.nano import Nano

SETTINGS = ("-o", "input_px=64", "-o", "batch=8", "-o", "augment=false", "-o", "size=nano")


@pytest.fixture(scope="module", params=["nano", "heatmap"])
def files(request, posse, dataset, tmp_path_factory):
    """A trained network's weights and its ONNX file, and a maker of such networks."""
    out = tmp_path_factory.mktemp(request.param)
    train = ("train", dataset.folder, "--detector", request.param, "--out", out, *SETTINGS)
    assert posse(*train, "-o", "epochs=3")[0] == 0
    exported = out / "net.onnx"
    code, _, error = posse("export-onnx", out / MODEL, "--dataset", dataset.folder, "--out", exported)
    assert code == 0, error
    make = {"nano": lambda: Nano(2, "nano"), "heatmap": lambda: HeatMaps(16, "nano")}[request.param]
    return out / MODEL, exported, make


def flat(outputs) -> torch.Tensor:
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    return torch.cat([value.flatten() for value in outputs])


def pictures(count: int) -> list[torch.Tensor]:
    """Discs of several sizes and shades before noise."""
    draw = torch.Generator().manual_seed(3)
    y, x = torch.meshgrid(torch.arange(64.0), torch.arange(64.0), indexing="ij")
    found = []
    for _ in range(count):
        u, v, radius, shade = (torch.rand(4, generator=draw) * torch.tensor([40, 40, 20, 0.8])).tolist()
        disc = ((x - 12 - u) ** 2 + (y - 12 - v) ** 2 < (4 + radius) ** 2).float() * (0.1 + shade)
        found.append((disc + 0.05 * torch.rand((64, 64), generator=draw)).clamp(0, 1)[None, None])
    return found


def test_it_computes_what_the_network_did_and_learns_from_there(files):
    """While it is trained, batch norms divide by what they see: there it computes the same, too, up to
    the difference between these pictures and those that the first training saw last."""
    own, exported, make = files
    nets = [make(), make(), make()]
    read_like(own, nets[0])
    read_like(exported, nets[1])
    seen = pictures(64)
    with torch.no_grad():
        for net in nets[:2]:
            net.eval()
        before = [flat(net(torch.cat(seen[:8]))) for net in nets[:2]]
        torch.testing.assert_close(before[1], before[0], rtol=1e-3, atol=1e-3)
        crude = copy.deepcopy(nets[1])
        measure_norms(nets[0], iter(seen))
        measure_norms(nets[1], iter(seen))
        torch.testing.assert_close(flat(nets[1](torch.cat(seen[:8]))), before[0], rtol=1e-3, atol=1e-3)
        trained, carried, unmeasured = (
            flat(net.train()(torch.cat(seen[:32]))) for net in (nets[0], nets[1], crude)
        )
    torch.testing.assert_close(carried, trained, rtol=1e-2, atol=1e-2)
    assert (unmeasured - trained).abs().mean() > 10 * (carried - trained).abs().mean()


def test_the_command_carries_it_on(files, posse, dataset, tmp_path):
    """Its losses are near those of the network itself, and far from those of one that knows nothing."""
    own, exported, _ = files
    told = []
    for number, start in enumerate((f"start={own}", f"start={exported}", "start=null")):
        train = ("train", dataset.folder, "--detector", ModelCard.read(own).net, *SETTINGS)
        more = ("--out", tmp_path / str(number), "-o", "epochs=1", "-o", start)
        code, _, error = posse(*train, *more, "-o", "learning_rate=1e-6")
        assert code == 0, error
        told.append(float(error.split("epoch 1, ")[1].split(",")[0].split()[1]))
    assert abs(told[1] - told[0]) < 0.1 * (told[2] - told[0])


def test_measuring_a_batch_norm_leaves_what_it_computes():
    """Negative scales too."""
    net = nn.Sequential(nn.Conv2d(1, 4, 3, bias=False), nn.BatchNorm2d(4)).eval()
    with torch.no_grad():
        net[1].weight.copy_(torch.tensor([1.5, -0.7, 0.2, 3.0]))
        net[1].bias.copy_(torch.tensor([0.1, 0.2, -0.3, 0.0]))
        net[1].running_mean.copy_(torch.tensor([0.3, -0.1, 0.0, 2.0]))
        seen = torch.rand(40, 1, 9, 9, generator=torch.Generator().manual_seed(1))
        before = net(seen)
        measure_norms(net, iter(seen.split(10)))
        torch.testing.assert_close(net(seen), before)
        torch.testing.assert_close(net.train()(seen), before, rtol=1e-3, atol=1e-3)


def test_what_cannot_be_carried_on_is_refused(files, tmp_path):
    """A file whose batch norms went elsewhere, of which half would be loaded, and one that is none."""
    model = onnx.load(files[1])
    for value in [*model.graph.initializer, *model.graph.node]:
        value.name = value.name.replace("weight_bias", "b")
    for node in model.graph.node:
        for number, name in enumerate(node.input):
            node.input[number] = name.replace("weight_bias", "b")
    onnx.save(model, tmp_path / "other.onnx")
    with pytest.raises(InputError, match="cannot be trained further"):
        read_like(tmp_path / "other.onnx", files[2]())
    (tmp_path / "text.onnx").write_text("no graph")
    with pytest.raises(InputError, match="is not an ONNX file"):
        read_like(tmp_path / "text.onnx", files[2]())
