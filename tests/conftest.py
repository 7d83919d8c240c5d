"""The same for every test."""

import os

from hypothesis import settings

# Processes that tests start run the installed package, as users do, wherever they are started.
os.environ["PYTHONSAFEPATH"] = "1"

# The same examples on every machine and in every run, however slow it is.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
