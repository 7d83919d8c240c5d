"""Worker processes and threads that end with this process, however it ends."""

import asyncio
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import parent_process, resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import TypeVar

T = TypeVar("T")


@contextmanager
def deaf_to_ctrl_c() -> Iterator[None]:
    """Have processes that are started within never hear Ctrl-C: a terminal tells all, and their parent ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Worker(SpawnProcess):
    def start(self) -> None:
        resource_tracker.ensure_running()  # started within, it would end the deafness
        with deaf_to_ctrl_c():
            super().start()


class _Context(SpawnContext):
    Process = _Worker


SPAWN = _Context()
"""Sockets, and the threads of compiled kernels, must not be copied into a worker."""


class _Workers(ProcessPoolExecutor):
    def __exit__(self, kind: type[BaseException] | None, error: object, trace: object) -> None:
        """Wait for what is asked; after an error nobody wants it any more."""
        if kind is None:
            self.shutdown()
        else:
            end(self)


def workers(processes: int = 1, *, niceness: int = 0) -> ProcessPoolExecutor:
    """Return a pool of processes. niceness: by how much they stand back behind this process."""
    return _Workers(processes, mp_context=SPAWN, initializer=_prepare, initargs=(niceness,))


def end(pool: ProcessPoolExecutor) -> None:
    """End a pool's processes. What they still work on is not waited for: the answer has nowhere to go."""
    processes = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.kill()  # one that is stopped, or hangs in a kernel, heeds nothing else
        process.join()


def ended(pool: ProcessPoolExecutor) -> bool:
    """Return whether a process of a pool that was asked something has ended by itself."""
    processes = pool._processes
    return processes is None or any(not process.is_alive() for process in list(processes.values()))


async def in_thread(function: Callable[[], T]) -> T:
    """Return what a function returns that takes long, and raise what it raises; the event loop goes on meanwhile.

    Unlike asyncio's own, the thread keeps no process from ending.
    """
    loop, done = asyncio.get_running_loop(), asyncio.Event()
    outcome: Future[T] = Future()

    def run() -> None:
        try:
            outcome.set_result(function())
        except BaseException as error:  # noqa: BLE001 - it is raised where the function was asked for
            outcome.set_exception(error)
        with suppress(RuntimeError):  # the loop may have been closed
            loop.call_soon_threadsafe(done.set)

    threading.Thread(target=run, daemon=True).start()
    await done.wait()
    return outcome.result()


def stop_on_signals(stop: Callable[[], object], *, patience_s: float) -> None:
    """Call ``stop`` in the running event loop at SIGINT or SIGTERM, and end the process if it is there after a while.

    Not the loop's own signal handlers: these wait for whatever the loop is busy with.
    """
    loop = asyncio.get_running_loop()

    def give_up() -> None:
        os.write(2, f"hsop-gcs: still busy {patience_s:g} s after a signal to stop; ended\n".encode())
        os._exit(1)

    def on_signal(*_: object) -> None:
        timer = threading.Timer(patience_s, give_up)
        timer.daemon = True
        timer.start()
        loop.call_soon_threadsafe(stop)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)


def end_with_parent() -> None:
    """Have this worker end as soon as the process that started it is gone, even by a signal that it could not see."""
    parent = parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _prepare(niceness: int) -> None:
    os.nice(niceness)
    end_with_parent()
