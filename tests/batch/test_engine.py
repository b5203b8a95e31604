"""Tasks on executors: threads, processes, a dask cluster; workers that die; stops."""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from dyehouse.batch import engine
from dyehouse.batch.catalog import Run, Settings
from dyehouse.batch.cli import main
from dyehouse.batch.jobs import gather
from dyehouse.core.errors import FileError

from .catalogs import catalog, files_of


def test_results_of_all_tasks_and_a_bounded_number_in_flight():
    taken = []

    def tasks():
        for k in range(100):
            taken.append(k)
            yield k

    seen = []
    for result in engine.run(tasks(), lambda k: k * k, lambda: ThreadPoolExecutor(2), 2, lambda task, reason: reason):
        seen.append(result)
        assert len(taken) - len(seen) <= 4 + 1
    assert sorted(seen) == [k * k for k in range(100)]


def test_what_a_task_raises_is_told():
    def work(k):
        if k == 3:
            raise ValueError("not this one\nsecond line")
        return k

    found = list(engine.run(range(5), work, lambda: ThreadPoolExecutor(1), 1, lambda task, reason: (task, reason)))
    assert sorted(found, key=str) == [(3, "not this one"), 0, 1, 2, 4]


def test_a_stop_drops_what_has_not_begun():
    stop, begun = engine.Stop(), []

    def work(k):
        begun.append(k)
        time.sleep(0.05)
        return k

    for _ in engine.run(range(50), work, lambda: ThreadPoolExecutor(2), 2, lambda *_: None, stop):
        stop.asked = True
    assert len(begun) <= 6


def test_an_executor_that_is_gone_is_not_waited_for():
    class Gone(ThreadPoolExecutor):
        def submit(self, *_):
            return Future()

    found = engine.run(range(3), int, lambda: Gone(1), 1, lambda task, reason: reason, alive=lambda: False)
    with pytest.raises(engine.LostError, match="is gone"):
        list(found)


def test_an_executor_that_takes_no_more_is_told():
    pool = ThreadPoolExecutor(1)

    def work(k):
        pool.shutdown(wait=False)
        return k

    found = engine.run(range(9), work, lambda: pool, 1, lambda task, reason: reason)
    with pytest.raises(engine.LostError, match="No more work can be handed out"):
        list(found)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted in /proc")
def test_workers_calculate_with_their_share_of_threads():
    # In a process of its own, whose fork server no other test has started.
    script = """
from dyehouse.batch import engine
square = "__import__('numpy').ones((900, 900))"
count = f"[{square} @ {square}, len(__import__('os').listdir('/proc/self/task'))][1]"
if __name__ == "__main__":
    with engine.processes(2, 1, bool)() as pool:
        print(pool.submit(eval, count).result())
"""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "2\n"  # one that works, and one that waits for the end of the run


def test_only_the_task_that_kills_its_worker_fails():
    # Builtins, as a worker process cannot import a test.
    executor = engine.processes(2, 1, bool)
    deadly = "__import__('os').kill(__import__('os').getpid(), 9)"
    tasks = [str(k) for k in range(6)] + [deadly] + [str(k) for k in range(6, 12)]
    found = list(engine.run(tasks, eval, executor, 2, lambda task, reason: (task, reason)))
    assert sorted(r for r in found if isinstance(r, int)) == list(range(12))
    ((task, reason),) = [r for r in found if isinstance(r, tuple)]
    assert task == deadly
    assert "the worker process died" in reason


# --- a cluster ------------------------------------------------------------------------------------------------

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


@pytest.fixture
def shop(tmp_path, product):
    return catalog(tmp_path / "shop", product, 4)


def test_a_local_cluster_gives_the_same_files(tmp_path, shop, capsys):
    from distributed import LocalCluster

    assert main(["batch", str(shop), "--out", str(tmp_path / "own"), "--workers", "0"]) == 0
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        arguments = ["batch", str(shop), "--out", str(tmp_path / "out"), "--scheduler", cluster.scheduler_address]
        assert main(arguments) == 0
        assert "8 done" in capsys.readouterr().out
        assert main([*arguments, "--resume", "--per-task", "3"]) == 0
        assert "8 kept" in capsys.readouterr().out
    assert files_of(tmp_path / "out") == files_of(tmp_path / "own")


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def machines(tmp_path):
    """A scheduler and two workers, each a process of its own; gives address, workers and scheduler."""
    address = f"tcp://127.0.0.1:{free_port()}"
    environment = os.environ | {"DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "10s"}
    with contextlib.ExitStack() as stack:

        def start(module, *arguments):
            command = [sys.executable, "-m", module, *arguments]
            process = subprocess.Popen(
                command, env=environment, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        scheduler = start("distributed.cli.dask_scheduler", "--port", address.rpartition(":")[2], "--no-dashboard")
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path))
        yield address, [start("distributed.cli.dask_worker", address, *options) for _ in range(2)], scheduler


def test_a_worker_of_a_cluster_killed_midway(tmp_path, product, machines, capsys):
    address, workers, _ = machines
    table = catalog(tmp_path / "shop", product, 8, size=160)
    assert main(["batch", str(table), "--out", str(tmp_path / "own"), "--workers", "0"]) == 0
    jobs, problems = gather([str(table)])
    assert not problems
    run = Run(jobs, Settings(str(tmp_path / "out"), scheduler=address))
    statuses = []
    for entry in run.entries():
        statuses.append(entry["status"])
        if len(statuses) == 2:
            workers[0].kill()
    assert statuses == ["done"] * 16
    assert workers[0].wait() == -signal.SIGKILL
    assert workers[1].poll() is None
    assert files_of(tmp_path / "out") == files_of(tmp_path / "own")


def test_a_cluster_that_is_lost_midway(tmp_path, product, machines):
    address, _, scheduler = machines
    table = catalog(tmp_path / "shop", product, 12, size=160)
    arguments = ["batch", str(table), "--out", str(tmp_path / "out")]
    command = [sys.executable, "-m", "dyehouse", *arguments, "--json", "--scheduler", address]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.readline()
        scheduler.kill()
        try:
            said, err = process.communicate(timeout=120)
        finally:
            process.kill()
    assert process.returncode == 2
    assert "Traceback" not in err
    summary = json.loads(said.splitlines()[-1])["summary"]
    assert summary["done"] < 24
    assert re.search("The scheduler is gone|No more work can be handed out", summary["stopped"])
    assert "go on with --resume" in summary["stopped"]
    assert main([*arguments, "--resume", "--workers", "0"]) == 0
    assert main(["batch", str(table), "--out", str(tmp_path / "own"), "--workers", "0"]) == 0
    assert files_of(tmp_path / "out") == files_of(tmp_path / "own")


def test_a_scheduler_that_is_not_there(tmp_path, shop, capsys, monkeypatch):
    monkeypatch.setattr(engine, "_REACHED", 1)
    address = f"tcp://127.0.0.1:{free_port()}"
    assert main(["batch", str(shop), "--out", str(tmp_path / "out"), "--scheduler", address]) == 2
    assert f"The scheduler '{address}' gives no workers" in capsys.readouterr().err
    assert main(["batch", str(shop), "--out", str(tmp_path / "out"), "--scheduler", "x://y", "--json"]) == 2
    assert "gives no workers" in json.loads(capsys.readouterr().out)["error"]


def test_without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(FileError, match=r"pip install distributed"), engine.cluster("tcp://x:1"):
        pass
