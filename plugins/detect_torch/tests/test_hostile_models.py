"""Model files whose header, card or tensors are of another shape are refused in one line."""

import json

import pytest
import torch

from posse_core import InputError, ModelCard
from posse_detect_torch.checkpoint import read_like, read_state, write_model
from posse_detect_torch.nano import Nano
from posse_detect_torch.nano_detector import NanoDetector
from posse_detect_torch.options import NanoOptions, SdnOptions
from posse_detect_torch.sdn_detector import SdnDetector


def with_header(path, header):
    """The file of a model with another header, JSON or text."""
    data = path.read_bytes()
    length = int.from_bytes(data[:8], "little")
    text = (header if isinstance(header, str) else json.dumps(header)).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + data[8 + length :])


def header_of(path):
    data = path.read_bytes()
    return json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "m.safetensors"
    write_model(path, Nano(1).state_dict(), ModelCard("nano", "boxes", ("a",), 64, "", "", "0"))
    return path


def refused(act, path, words):
    with pytest.raises(InputError, match=words) as told:
        act(path)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda header: [header], "not a safetensors file"),
        (lambda header: {**header, "__metadata__": 3}, "not a safetensors file: __metadata__"),
        (lambda header: {**header, "__metadata__": {"posse_model": "[]"}}, "metadata cannot be read"),
        (lambda header: "[" * 10_000, "not a safetensors file"),
        (lambda header: "", "not a safetensors file"),
    ],
)
def test_headers(model, change, words):
    with_header(model, change(header_of(model)))
    refused(NanoDetector(NanoOptions()).load, model, rf"m\.safetensors: .*{words}")


@pytest.mark.parametrize(
    ("entry", "value"),
    [("dtype", "X9"), ("data_offsets", [0, 2**60]), ("shape", [2**40]), ("shape", "x")],
)
def test_tensors(model, entry, value):
    header = header_of(model)
    name = next(name for name in header if name != "__metadata__")
    header[name][entry] = value
    with_header(model, header)
    for act in (NanoDetector(NanoOptions()).load, lambda path: read_like(path, Nano(1)), read_state):
        refused(act, model, r"m\.safetensors: ")


def test_options_of_another_shape(tmp_path):
    path = tmp_path / "s.safetensors"
    card = ModelCard("sdn", "boxes", ("a",), 64, "", "", "0", options={"depth": "deep"})
    write_model(path, {"x": torch.zeros(1)}, card)
    refused(SdnDetector(SdnOptions()).load, path, r"s\.safetensors: its POSSE metadata .*options\.depth")


def test_a_state_of_another_shape(model):
    header = header_of(model)
    header["__metadata__"]["posse_training"] = '{"epoch": []}'
    with_header(model, header)
    refused(read_state, model, "the state of its training is damaged")
