"""The letter's baseline (section V): the same constraints, no cost."""

from itertools import islice

import numpy as np

from hsop_gcs.placement.hsop import CHUNK, Best, Search, views_of
from hsop_gcs.placement.interior_point import INSIDE, margins, reach_feasibility


def cover(search: Search, n_hosts: int) -> Best | None:
    """Return the first placement found that sees every threat with ``n_hosts``; None if there is none by the deadline.

    Which one it is depends on the search's seed alone: a pair set, its cameras and the poses are taken as they come.
    """
    waiting = search.all_choices(n_hosts)
    while chunk := list(islice(waiting, CHUNK)):
        batch, of_choice = search.starts(chunk, 8, by_cost=False)
        views = views_of(chunk).rows(of_choice)
        for attempt in (batch, reach_feasibility(search.instance, batch, views)):
            terms = margins(search.instance, attempt, views)
            found = np.flatnonzero((terms.margin >= INSIDE) & np.isfinite(terms.log_cost))
            if found.size:
                first = int(found[0])
                return Best(chunk[of_choice[first]], attempt[first], float(np.exp(terms.log_cost[first])))
        if search.late():
            break
    return None
