"""A small seeded generator for the kernels (splitmix64): its state is an argument, so every run can be repeated."""

import numpy as np
import numpy.typing as npt

from hsop_gcs.geometry.compiled import lean_kernel

State = npt.NDArray[np.uint64]
"""One number, advanced by every draw."""

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


def seeded(*words: int) -> State:
    """Return a generator state that depends on all words."""
    return np.random.SeedSequence(words).generate_state(2).view(np.uint64)


@lean_kernel
def uniform(state: State) -> float:
    """Draw from [0, 1)."""
    state[0] = state[0] + _STEP
    z = state[0]
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    z = z ^ (z >> _31)
    return float(z >> _11) * (1.0 / 9007199254740992.0)


@lean_kernel
def below(state: State, count: int) -> int:
    """Draw an integer from 0 to count - 1."""
    return int(uniform(state) * count)


@lean_kernel
def bell(state: State) -> float:
    """Draw a symmetric bell-shaped number of unit variance, never beyond 3.5."""
    return (uniform(state) + uniform(state) + uniform(state) + uniform(state) - 2.0) * 1.7320508075688772
