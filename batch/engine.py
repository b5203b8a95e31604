"""Many tasks on any `concurrent.futures.Executor`, a bounded number at a time, whatever happens to the workers."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from typing import Any

from ..core.errors import DyehouseError, FileError

# Tasks that wait beside each one that is being worked on.
_AHEAD = 2

# Seconds in which a scheduler must answer.
_REACHED = 10

# Seconds between looks at whether a stop is asked for.
_PULSE = 0.2


class LostError(DyehouseError):
    """An executor that takes no more tasks, such as a cluster that is gone."""


class Stop:
    """Asks a run to end: what is being worked on is finished, nothing more is begun."""

    asked = False


def run[Task, Result](
    tasks: Iterable[Task],
    work: Callable[[Task], Result],
    executor: Callable[[], Executor],
    workers: int,
    failed: Callable[[Task, str], Result],
    stop: Stop | None = None,
    alive: Callable[[], bool] = lambda: True,
) -> Generator[Result]:
    """Do tasks; yields results as they come.

    Parameters
    ----------
    tasks
        What to do. They are taken as they can be worked on, so that a million of them need no memory.
    work
        Does one; it and the tasks must be picklable for executors that want that.
    executor
        Makes an executor; called again if a worker's death has broken the first.
    workers
        How many tasks it works on at a time.
    failed
        Makes the result of a task that could not be done, of the task and the reason.
    stop
        Looked at between results.
    alive
        Looked at when nothing comes: whether the executor is still there.

    Raises
    ------
    LostError
        If the executor takes no more tasks, or is not there.
    """
    stop = stop or Stop()
    queue = iter(tasks)
    pool = executor()
    waiting: dict[Future[Result], Task] = {}
    try:
        while True:
            suspects: list[Task] = []
            while not stop.asked and len(waiting) < _AHEAD * workers and (task := next(queue, None)) is not None:
                try:
                    waiting[pool.submit(work, task)] = task
                except BrokenExecutor:  # a worker died between two looks
                    suspects.append(task)
                    break
                except Exception as error:
                    raise LostError(f"No more work can be handed out ({_reason(error)})") from None
            if not waiting and not suspects:
                return
            if stop.asked:
                for future in [future for future in waiting if future.cancel()]:
                    del waiting[future]
            done = wait(waiting, timeout=_PULSE, return_when=FIRST_COMPLETED).done
            if not done and not alive():
                waiting.clear()  # of which nothing will be heard
                raise LostError("The scheduler is gone")
            for future in done:
                task = waiting.pop(future)
                try:
                    yield future.result()
                except BrokenExecutor:
                    suspects.append(task)
                except (Exception, CancelledError) as error:  # what the executor itself says, such as a lost cluster
                    yield failed(task, _reason(error))
            if suspects:
                suspects += waiting.values()
                waiting.clear()
                pool.shutdown(wait=False)
                yield from _one_by_one(suspects, work, executor, failed, stop)
                pool = executor()
    except LostError:
        with contextlib.suppress(Exception):  # nobody answers
            pool.shutdown(wait=False)
        raise
    finally:
        for future in waiting:
            future.cancel()
        pool.shutdown(wait=True)


def _one_by_one[Task, Result](
    suspects: list[Task],
    work: Callable[[Task], Result],
    executor: Callable[[], Executor],
    failed: Callable[[Task, str], Result],
    stop: Stop,
) -> Iterator[Result]:
    """Do what was under way when a worker died, alone, so that only the task that kills its worker fails."""
    pool = executor()
    try:
        for task in suspects:
            if stop.asked:
                return
            try:
                yield pool.submit(work, task).result()
            except BrokenExecutor:
                pool.shutdown(wait=False)
                pool = executor()
                yield failed(task, "the worker process died, most likely for want of memory: use fewer --workers")
    finally:
        pool.shutdown(wait=True)


def _reason(error: BaseException) -> str:
    return str(error).strip().split("\n")[0] or type(error).__name__


def processes(workers: int, threads: int, begin: Callable[..., None], *arguments: Any) -> Callable[[], Executor]:
    """Executors of worker processes on this machine.

    Parameters
    ----------
    workers, threads
        Processes, and threads that each may use.
    begin, arguments
        Called once in every worker.
    """

    def make() -> Executor:
        import multiprocessing

        # For the libraries of linear algebra that workers load, which have threads of their own beside ours.
        os.environ.setdefault("OMP_NUM_THREADS", str(threads))
        # A fork of a process with threads may hang; a fork server is as fast as a fork and has none.
        context = multiprocessing.get_context("forkserver" if os.name == "posix" else "spawn")
        if os.name == "posix":
            context.set_forkserver_preload([f"{__package__}.work"])
        return ProcessPoolExecutor(workers, context, _begin, (threads, begin, arguments))

    return make


def threads_of(workers: int) -> Callable[[], Executor]:
    """Executors of threads of this process, for programs that cannot start others, such as Blender."""
    return lambda: ThreadPoolExecutor(workers)


@contextlib.contextmanager
def cluster(address: str) -> Iterator[tuple[Callable[[], Executor], int, Callable[[], bool]]]:
    """Give executors of a dask.distributed cluster, how many tasks it works on at a time, and whether it is alive.

    Raises
    ------
    FileError
        If dask is not installed, the scheduler cannot be reached, or it has no workers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise FileError("A scheduler needs dask.distributed, which is not installed: pip install distributed") from None
    # Of a scheduler that is lost its own threads log tracebacks; what has happened is told in words.
    for name in ("distributed", "distributed.client", "tornado.application", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        try:
            client = stack.enter_context(Client(address, timeout=_REACHED))
            client.wait_for_workers(1, timeout=_REACHED)
        except (OSError, TimeoutError, ValueError) as error:
            raise FileError(
                f"The scheduler '{address}' gives no workers ({_reason(error)}): check that it and its workers run."
            ) from None
        yield (
            lambda: client.get_executor(pure=False),
            sum(client.nthreads().values()),
            lambda: client.status != "closed",
        )


def _begin(threads: int, begin: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """Prepare a worker process: it ends with the run that it belongs to, and leaves Ctrl-C to it."""
    import signal

    # The core uses as many threads as there are cores for this process; these are its share of them.
    vars(os)["process_cpu_count"] = lambda: threads
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    begin(*arguments)


def _end_with_parent() -> None:
    from multiprocessing import connection, parent_process

    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
