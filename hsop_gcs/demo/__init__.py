"""The demonstration: a service, a simulated fleet in a process of its own, and a console that talks to both over HTTP.

Everything goes the way it would in the field: reports over HTTP, approval by a console, MAVLink over UDP. Only the
threats and the aircraft are made up.
"""

from hsop_gcs.demo.outcome import Errors, Outcome, Row, Summary
from hsop_gcs.demo.run import run_demo

__all__ = ["Errors", "Outcome", "Row", "Summary", "run_demo"]
