"""The same for every test."""

import os

import pytest
from hypothesis import settings

from hsop_gcs.geometry import triangulation
from hsop_gcs.placement.search import warm_up, warm_up_beside
from hsop_gcs.tracks import track_kernels
from hsop_gcs.workers import SPAWN

# The same examples on every machine and in every run, however slow it is.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

# Programs that tests start are those of the package that is tested, not of the folder they are started in: its kernels
# would have to be compiled too.
os.environ["PYTHONSAFEPATH"] = "1"


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels, on both cores, before workers do so each for itself."""
    if session.config.getoption("numprocesses", None):
        beside = SPAWN.Process(target=warm_up_beside)
        beside.start()
        warm_up()
        track_kernels.warm_up()
        triangulation.warm_up()
        beside.join()
