"""Compilation of the numerical kernels, cached on disk so that only the first run on a machine pays for it."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def kernel(function: Kernel) -> Kernel:
    """Compile ``function`` on first call: no bounds checks, no interpreter lock, division by zero gives infinity."""
    return cast(Kernel, numba.njit(cache=True, nogil=True, error_model="numpy")(function))


def lean_kernel(function: Kernel) -> Kernel:
    """Compile a function that allocates nothing, without reference counts: they cost more than a small sum."""
    return cast(Kernel, numba.njit(cache=True, nogil=True, error_model="numpy", _nrt=False)(function))
