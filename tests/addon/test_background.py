"""Work in threads: one piece at a time, errors told to who asks, and the last results kept."""

import threading
import time
from collections.abc import Callable, Iterator

import bpy
import pytest

from dyehouse.addon import background
from dyehouse.core.errors import DyehouseError


@pytest.fixture
def worker() -> Iterator[background.Worker[str]]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    background.register()
    made: background.Worker[str] = background.Worker()
    yield made
    background.unregister()


def until_done(worker: background.Worker) -> None:
    while worker.busy():
        time.sleep(0.001)


def test_it_is_made_once_in_another_thread(worker: background.Worker[str]) -> None:
    threads: list[object] = []

    def make() -> str:
        threads.append(threading.current_thread())
        return "made"

    assert worker.ask("key", lambda: make) is None
    until_done(worker)
    assert worker.ask("key", lambda: make) == "made"
    assert worker.now("key", lambda: make) == "made"
    assert len(threads) == 1
    assert threads[0] is not threading.current_thread()


def test_only_one_is_made_at_a_time(worker: background.Worker[str]) -> None:
    go = threading.Event()

    def slow() -> Callable[[], str]:
        return lambda: "slow" if go.wait(10) else ""

    def never() -> Callable[[], str]:
        raise AssertionError("begun while another is at work")

    assert worker.ask("slow", slow) is None
    assert worker.ask("other", never) is None
    go.set()
    until_done(worker)
    assert worker.ask("slow", never) == "slow"


def test_an_error_is_told_each_time(worker: background.Worker[str]) -> None:
    def make() -> str:
        raise DyehouseError("It cannot be: do another thing.")

    assert worker.ask("key", lambda: make) is None
    until_done(worker)
    for _ in range(2):
        with pytest.raises(DyehouseError, match="It cannot be"):
            worker.ask("key", lambda: make)


def test_want_of_memory_is_told_in_words(worker: background.Worker[str]) -> None:
    def make() -> str:
        raise MemoryError

    worker.ask("key", lambda: make)
    until_done(worker)
    with pytest.raises(DyehouseError, match="not enough memory"):
        worker.ask("key", lambda: make)


def test_the_last_two_are_kept(worker: background.Worker[str]) -> None:
    for key in "abc":
        worker.now(key, lambda key=key: lambda: key)
    assert [worker.found(key) for key in "abc"] == [None, "b", "c"]
    worker.found("b")
    worker.now("d", lambda: lambda: "d")
    assert [worker.found(key) for key in "bcd"] == ["b", None, "d"]


def test_what_is_taken_is_kept_no_longer(worker: background.Worker[str]) -> None:
    worker.now("key", lambda: lambda: "made")
    assert worker.take("key") == "made"
    assert worker.take("key") is None


def test_unregistering_drops_everything(worker: background.Worker[str]) -> None:
    worker.now("key", lambda: lambda: "made")
    background.unregister()
    assert worker.found("key") is None
