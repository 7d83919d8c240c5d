"""The same for every test."""

from hypothesis import settings

# The same examples on every machine and in every run, however slow it is.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
