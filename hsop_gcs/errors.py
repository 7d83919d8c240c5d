"""What can go wrong that is nobody's programming error.

HsopError
├── BadInput          a value somebody gave cannot be used; names the field and the value
├── NotKnown          what was asked for does not exist
├── Refused           an operator's wish that cannot be granted now; says why
└── Unavailable       something needed is not there (a port, a file, a service); says which

A caller's mistake inside the library stays a ``ValueError``; an infeasible placement is an answer, not an error;
a bad packet is counted. Only the API layer turns these into HTTP, only the command line into exit codes.
"""


class HsopError(Exception):
    """Base of everything a user can be told about in one line."""


class BadInput(HsopError):
    """A value that cannot be used."""

    def __init__(self, field: str, problem: str) -> None:
        super().__init__(field, problem)  # its own arguments: so it can be pickled, and leave a worker process
        self.field = field
        self.problem = problem

    def __str__(self) -> str:
        return f"{self.field}: {self.problem}"


class NotKnown(HsopError):
    """A plan, a host or a threat that does not exist."""


class Refused(HsopError):
    """An operator's wish that cannot be granted now."""


class Unavailable(HsopError):
    """Something outside is not there."""
