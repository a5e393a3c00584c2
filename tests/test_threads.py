"""Work in threads: the same results in the same order, however many there are."""

import threading
import time

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from posse_core import _threads
from posse_core._spacecraft.cubesat import Cubesat, CubesatOptions
from posse_core._threads import in_threads, one_thread_for_algebra, thread_count


def test_the_results_are_in_the_order_of_the_items(monkeypatch):
    monkeypatch.setenv("POSSE_THREADS", "4")
    names = set()

    def work(item: int) -> int:
        names.add(threading.current_thread().name)
        time.sleep(0.001 * (item % 3))
        return item**2

    assert in_threads(work, range(40)) == [item**2 for item in range(40)]
    assert len(names) == 4


def test_one_thread_is_the_caller_itself(monkeypatch):
    monkeypatch.setenv("POSSE_THREADS", "1")
    assert set(in_threads(lambda _: threading.current_thread(), range(3))) == {
        threading.current_thread()
    }


def test_what_the_work_raises_is_raised(monkeypatch):
    monkeypatch.setenv("POSSE_THREADS", "2")
    with pytest.raises(ZeroDivisionError):
        in_threads(lambda item: 1 / item, [1, 0, 2])


def test_without_a_share_there_is_a_thread_for_each_core(monkeypatch):
    monkeypatch.delenv("POSSE_THREADS", raising=False)
    assert thread_count() >= 1


@pytest.mark.parametrize("share", ["", "0", "-1", "many", "1.5"])
def test_a_share_that_is_no_number_above_0_counts_as_none(monkeypatch, share):
    monkeypatch.delenv("POSSE_THREADS", raising=False)
    without = thread_count()
    monkeypatch.setenv("POSSE_THREADS", share)
    assert thread_count() == without


def test_the_textures_of_a_built_in_craft_are_the_same_to_the_bit(monkeypatch):
    made = []
    for count in ("1", "2", "5"):
        monkeypatch.setenv("POSSE_THREADS", count)
        made.append(Cubesat(CubesatOptions(variant_seed=3)).build().materials)
    first, *others = made
    textured = [m for m in first.values() if m.base_color_texture is not None]
    assert textured
    for other in others:
        assert list(other) == list(first)
        for name, material in first.items():
            assert material.base_color == other[name].base_color
            for key in ("base_color_texture", "metallic_roughness_texture", "normal_texture"):
                assert np.array_equal(getattr(material, key), getattr(other[name], key))


def test_within_the_context_algebra_has_one_thread() -> None:
    def threads() -> list[int]:
        return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]

    _threads._libraries.cache_clear()  # other tests may have loaded libraries since
    with threadpool_limits(2, "blas"):
        before = threads()
        with one_thread_for_algebra():
            assert set(threads()) == {1}
        assert threads() == before
    assert 2 in before
