"""Worker processes that end with this one, however this one ends."""

import os
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process

SPAWN = get_context("spawn")
"""Sockets, and the threads of compiled kernels, must not be copied into a worker."""


def workers(processes: int = 1, *, niceness: int = 0) -> ProcessPoolExecutor:
    """Return a pool of processes. niceness: by how much they stand back behind this process."""
    return ProcessPoolExecutor(processes, mp_context=SPAWN, initializer=_prepare, initargs=(niceness,))


def end(pool: ProcessPoolExecutor) -> None:
    """End a pool's processes. What they still work on is not waited for: the answer has nowhere to go."""
    processes = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.terminate()
        process.join()


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
