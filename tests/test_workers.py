"""Processes that end when they are told to, whatever they are busy with."""

import asyncio
import subprocess
import sys
import threading

import pytest

from hsop_gcs.workers import in_thread

STOPPING = """
import asyncio, time
from hsop_gcs.workers import stop_on_signals

async def main():
    stop = asyncio.Event()
    stop_on_signals(stop.set, patience_s={patience_s})
    print("ready", flush=True)
    while not stop.is_set():
        {busy}

asyncio.run(main())
"""


@pytest.mark.parametrize(
    ("busy", "patience_s", "code"), [("await asyncio.sleep(0.01)", 30.0, 0), ("time.sleep(0.01)", 0.2, 1)]
)
def test_a_process_ends_at_a_signal_also_if_its_event_loop_does_not_turn(
    busy: str, patience_s: float, code: int
) -> None:
    program = STOPPING.format(busy=busy, patience_s=patience_s)
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    process.terminate()
    _, err = process.communicate(timeout=30)
    assert process.returncode == code
    assert (b"still busy" in err) is bool(code)


def test_what_takes_long_runs_beside_the_event_loop_and_its_error_is_raised_where_it_was_asked_for() -> None:
    async def scenario() -> None:
        go_on = threading.Event()
        working = asyncio.create_task(in_thread(lambda: go_on.wait(30)))
        await asyncio.sleep(0)
        go_on.set()
        assert await working
        with pytest.raises(ZeroDivisionError):
            await in_thread(lambda: 1 / 0)

    asyncio.run(scenario())
