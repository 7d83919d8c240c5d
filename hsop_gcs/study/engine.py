"""Runs the trials of a study here, on a pool of processes, or on a Dask cluster: the same results each time."""

from collections.abc import Callable, Generator
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from importlib import import_module
from itertools import islice
from typing import Any

from hsop_gcs.errors import Unavailable
from hsop_gcs.study.results import Results
from hsop_gcs.study.trial import Record, Study, Trial, run_trial
from hsop_gcs.workers import workers

IN_FLIGHT = 4
"""Trials handed out per worker, so that an interrupted run has little unfinished."""


def run(
    results: Results,
    *,
    jobs: int = 1,
    dask: str | None = None,
    dask_timeout_s: float = 10.0,
    progress: Callable[[int, int], None] | None = None,
) -> list[Record]:
    """Run what is missing from ``results`` and return all records, in the order of the study's trials.

    jobs: processes; 1 is this one. dask: address of a scheduler, tcp://..., whose workers run the trials instead; they
    need this package. dask_timeout_s: how long to wait for the scheduler. progress: told how many trials are done, of
    how many. Raises Unavailable without the cluster, and when a worker process is killed.
    """
    missing = results.missing
    total = len(results.study.trials())
    done = total - len(missing)
    tell = progress or (lambda *_: None)
    tell(done, total)
    if dask is not None:
        finished: Generator[Record, None, None] = _on_dask(results.study, missing, dask, dask_timeout_s)
    elif jobs > 1:
        finished = _on_processes(results.study, missing, jobs)
    else:
        finished = (run_trial(results.study, trial) for trial in missing)
    with results.writing(), closing(finished):
        for record in finished:
            results.add(record)
            done += 1
            tell(done, total)
    return results.records


def _on_processes(study: Study, trials: list[Trial], jobs: int) -> Generator[Record, None, None]:
    """Yield records as they are finished."""
    waiting = iter(trials)
    with workers(jobs) as pool:
        running = {pool.submit(run_trial, study, trial) for trial in islice(waiting, IN_FLIGHT * jobs)}
        try:
            while running:
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                running |= {pool.submit(run_trial, study, trial) for trial in islice(waiting, len(finished))}
                for future in finished:
                    yield future.result()
        except BrokenProcessPool:
            raise Unavailable(
                "a worker process was killed; what is finished is kept: --resume goes on with it"
            ) from None


def _on_dask(study: Study, trials: list[Trial], address: str, timeout_s: float) -> Generator[Record, None, None]:
    """Yield records as a cluster finishes them; a worker that is lost has its trials run by the others."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise Unavailable("Dask is not installed; it comes with hsop-gcs[dask]") from None
    try:
        client = distributed.Client(address, timeout=timeout_s, set_as_default=False)
    except (OSError, ValueError) as error:
        raise Unavailable(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        futures = client.map(run_trial, [study] * len(trials), trials, pure=False)
        for future in distributed.as_completed(futures, loop=client.loop):
            yield future.result()
