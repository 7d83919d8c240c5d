"""The global placement search: annealing in compiled kernels, polished by an interior-point solve."""

from hsop_gcs.placement.search.solve import frontier, search, warm_up, warm_up_beside

__all__ = ["frontier", "search", "warm_up", "warm_up_beside"]
