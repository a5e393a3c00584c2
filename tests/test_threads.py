"""Work in threads: the same results in the same order, however many there are."""

import threading
import time

import numpy as np
import pytest

from posse_core._imaging.image_sensor import ImageSensor
from posse_core._model.camera import Camera
from posse_core._model.sky_view import SkyView
from posse_core._scenario.sensor import SensorConfig
from posse_core._threads import in_threads, thread_count


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


@pytest.mark.parametrize("color", ["mono", "rgb"])
def test_the_noise_is_the_same_to_the_bit(monkeypatch, color):
    camera = Camera(320, 240, 160.0, 160.0, 159.5, 119.5, 0.036)
    light = np.random.default_rng(0).random((240, 320, 3)).astype(np.float32) * 40
    sky = SkyView(light, np.empty((0, 2)), np.empty((0, 3)))
    sensor = ImageSensor(SensorConfig(color=color), camera)
    made = []
    for count in ("1", "2", "5"):
        monkeypatch.setenv("POSSE_THREADS", count)
        made.append(sensor.expose(sky, None, 0.002, 3, 7))
    assert made[0].std() > 0
    assert all(np.array_equal(made[0], other) for other in made[1:])
