"""Algorithm 3: the letter's HSOP method, the fewest hosts first; every pair set and camera choice solved by itself."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice, product

import numpy as np

from hsop_gcs.placement.covering import CoveringPoses
from hsop_gcs.placement.feasibility import CENTRAL, PERIPHERAL, Screen
from hsop_gcs.placement.instance import FloatArray, Instance
from hsop_gcs.placement.interior_point import INSIDE, Solution, margins, solve
from hsop_gcs.placement.pair_sets import PairSet, all_pair_sets, components, observed_threats, observer_pair_sets
from hsop_gcs.placement.terms import IntArray, Views

CHUNK = 128
"""Pair sets with cameras that are solved together."""
STARTS = 1024
"""Starts of a chunk at most, shared out evenly ..."""
HOSTS_STARTED = 4096
"""... and hosts in all these starts together."""
DRAWS_PER_START = 100
"""Random placements looked at for each start."""
APPRAISED = 2048
"""Random placements looked at together: what fits a processor's cache."""
ROUGH_BARRIERS = (1e-1, 1e-2)
FINE_BARRIERS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
REFINED = 48
"""Rough solutions of a chunk that are worth solving to the end."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A pair set with the cameras of each host."""

    pair_set: PairSet
    central: tuple[int, ...]
    """For each host the threats, as a bit mask, that it observes with its central camera; the others by a fisheye."""

    def camera(self, host: int, threat: int) -> int:
        """Return CENTRAL or PERIPHERAL: what the host observes the threat with."""
        return CENTRAL if self.central[host] >> threat & 1 else PERIPHERAL


@dataclass(frozen=True, slots=True)
class Best:
    """A choice with the poses found for it: (hosts, 4) east, north, heading, pan; metres, radians."""

    choice: Choice
    poses: FloatArray
    cost: float


class Search:
    """What one run of Algorithm 3 knows: the instance, its screen, its pool of poses and the best placement so far."""

    def __init__(
        self,
        instance: Instance,
        *,
        seed: int,
        deadline: float,
        now: Callable[[], float],
        observers: Callable[[int], tuple[int, ...]] | None = None,
        letters_cameras: bool = False,
    ) -> None:
        self.instance = instance
        self.screen = Screen(instance)
        self.poses = CoveringPoses(instance, self.screen, seed)
        self.rng = np.random.default_rng(seed)
        self.deadline = deadline
        self.now = now
        self.observers = observers
        self.letters_cameras = letters_cameras
        self.best: Best | None = None

    def late(self) -> bool:
        """Whether the deadline has passed."""
        return self.now() >= self.deadline

    def feasible_pair_sets(self, n_hosts: int) -> Iterator[PairSet]:
        """Yield the pair sets that use all hosts and give each of them threats it was found to see (Algorithm 2)."""

        def feasible(pair_set: PairSet) -> bool:
            if self.late() or not self.screen.feasible(pair_set):
                return False
            masks = observed_threats(pair_set)
            return all(self.poses.covers(masks[host]) for host in pair_set[-1])

        if self.observers is None:
            yield from all_pair_sets(len(self.instance.points_m), n_hosts, feasible)
            return
        for pair_set in observer_pair_sets(self.observers(n_hosts), n_hosts, feasible):
            masks = observed_threats(pair_set)
            if len(masks) == n_hosts and all(masks):
                yield pair_set

    def choices(self, pair_set: PairSet) -> Iterator[Choice]:
        """Yield the pair set with every useful combination of cameras, once where hosts see the same threats."""
        masks = observed_threats(pair_set)
        options = [
            self.poses.camera_types(mask)
            if self.letters_cameras
            else [c for c in self.screen.camera_choices(mask) if len(self.poses.poses(mask, c))]
            for mask in masks
        ]
        for central in product(*options):
            twins_in_order = all(
                central[i] <= central[j] for j in range(len(masks)) for i in range(j) if masks[i] == masks[j]
            )
            if twins_in_order or self.observers is not None:
                yield Choice(pair_set, central)

    def cannot_win(self, choice: Choice) -> bool:
        """Return whether no poses can make the choice cheaper than the best placement known.

        Nobody is nearer than the safety distance, and no sine exceeds 1.
        """
        if self.best is None:
            return False
        nearest = self.instance.safety_distance_m
        bound = 0.0
        for threat, pair in enumerate(choice.pair_set):
            share = 2.0 * float(self.instance.weights[threat])
            for host in pair:
                camera = choice.camera(host, threat)
                swell = self.instance.best_relative_size if camera == PERIPHERAL else 1.0
                share *= nearest**2 / (float(self.instance.scale[camera, threat]) * swell)
            bound += share
        return bound >= self.best.cost

    def solve_all(self, n_hosts: int) -> Best | None:
        """Solve every feasible pair set of ``n_hosts`` with every useful choice of cameras; return the best placement.

        Stops at the deadline with what it has, but not before one chunk is solved.
        """
        self.best = None
        useful = (choice for choice in self.all_choices(n_hosts) if not self.cannot_win(choice))
        while chunk := list(islice(useful, CHUNK)):
            self.solve_chunk(chunk)
            if self.late():
                break
        return self.best

    def all_choices(self, n_hosts: int) -> Iterator[Choice]:
        """Yield every feasible pair set with every choice of cameras."""
        for pair_set in self.feasible_pair_sets(n_hosts):
            for choice in self.choices(pair_set):
                yield choice
                if self.late():
                    return

    def solve_chunk(self, chunk: list[Choice]) -> None:
        """Solve choices together: draw starts from the hosts' poses, solve them roughly, and the best to the end."""
        n_hosts = 1 + max(host for pair in chunk[0].pair_set for host in pair)
        start, of_choice = self.starts(chunk, max(1, min(STARTS, HOSTS_STARTED // n_hosts) // len(chunk)))
        views = views_of(chunk).rows(of_choice)
        rough = solve(self.instance, start, views, barriers=ROUGH_BARRIERS, steps=40)
        self.keep(chunk, rough, of_choice)
        mixed, of_mixed = self.recombined(chunk, rough, of_choice)
        batch, of_choice = np.concatenate([rough.batch, mixed]), np.concatenate([of_choice, of_mixed])
        views = views_of(chunk).rows(of_choice)
        log_cost = margins(self.instance, batch, views).log_cost
        log_cost[: len(rough.cost)][np.isinf(rough.cost)] = np.inf
        best = np.argsort(log_cost, kind="stable")[:REFINED]
        fine = solve(self.instance, batch[best], views.rows(best), barriers=FINE_BARRIERS)
        self.keep(chunk, fine, of_choice[best])

    def recombined(self, chunk: list[Choice], rough: Solution, of_choice: IntArray) -> tuple[FloatArray, IntArray]:
        """Put the best found for each part of a choice together; parts of the host-threat graph share no host.

        Returns placements, (n, hosts, 4), and the numbers of their choices; none for choices of a single part.
        """
        terms = margins(self.instance, rough.batch, views_of(chunk).rows(of_choice))
        mixed, of_mixed = [np.empty((0, *rough.batch.shape[1:]))], []
        for k, choice in enumerate(chunk):
            solved = np.flatnonzero((of_choice == k) & np.isfinite(rough.cost))
            parts = components(choice.pair_set)
            if len(parts) == 1 or not solved.size:
                continue
            poses = rough.batch[solved[0]].copy()
            for hosts, threats in parts:
                cheapest = solved[terms.pair_cost[solved][:, threats].sum(axis=1).argmin()]
                poses[hosts] = rough.batch[cheapest, hosts]
            mixed.append(poses[None])
            of_mixed.append(k)
        return np.concatenate(mixed), np.array(of_mixed, dtype=np.intp)

    def starts(self, chunk: list[Choice], per_choice: int, *, by_cost: bool = True) -> tuple[FloatArray, IntArray]:
        """Draw poses for every choice of a chunk and return the most promising, by cost or by feasibility alone.

        Parts of the host-threat graph that share no host are ranked apart, and the best of each stand together.
        Returns the placements, (choices × per_choice, hosts, 4), and for each of them the number of its choice.
        """
        draws = DRAWS_PER_START * per_choice
        drawn = np.concatenate([self.draw(choice, draws) for choice in chunk])
        of_choice = np.arange(len(chunk))
        pair_cost, outside = self.appraise(drawn, views_of(chunk).rows(np.repeat(of_choice, draws)))
        promising = np.empty((len(chunk), per_choice, *drawn.shape[1:]))
        for k, choice in enumerate(chunk):
            block = slice(k * draws, (k + 1) * draws)
            parts = components(choice.pair_set) if by_cost else [(list(range(drawn.shape[1])), [])]
            for hosts, threats in parts:
                merit = np.log(pair_cost[block, threats].sum(axis=1)) if by_cost else np.zeros(draws)
                if len(parts) == 1:
                    merit = merit + outside[block]
                first = np.argsort(merit, kind="stable")[:per_choice]
                promising[k][:, hosts] = drawn[block][first][:, hosts]
        return promising.reshape(-1, *drawn.shape[1:]), np.repeat(of_choice, per_choice)

    def appraise(self, batch: FloatArray, views: Views) -> tuple[FloatArray, FloatArray]:
        """Return the pairs' costs, (B, pairs), and what counts against placements without positive margins, (B,)."""
        pair_costs, against = [], []
        for begin in range(0, len(batch), APPRAISED):
            some = np.arange(begin, min(begin + APPRAISED, len(batch)))
            terms = margins(self.instance, batch[some], views.rows(some))
            pair_costs.append(terms.pair_cost)
            against.append(np.where(terms.margin < INSIDE, 100 + terms.shaped, 0.0))
        return np.concatenate(pair_costs), np.concatenate(against)

    def draw(self, choice: Choice, count: int) -> FloatArray:
        """Draw placements at random, each host from the poses that see its own threats: (count, hosts, 4)."""
        masks = observed_threats(choice.pair_set)
        pools = [self.poses.poses(mask, central) for mask, central in zip(masks, choice.central, strict=True)]
        return np.stack([pool[self.rng.integers(len(pool), size=count)] for pool in pools], axis=1)

    def keep(self, chunk: list[Choice], solution: Solution, of_choice: IntArray) -> None:
        """Constraints-Check, and remember the solution if it is the cheapest so far (Algorithm 3, lines 7-9)."""
        if not len(solution.cost):
            return
        winner = int(solution.cost.argmin())
        cost = float(solution.cost[winner])
        if np.isfinite(cost) and (self.best is None or cost < self.best.cost):
            self.best = Best(chunk[of_choice[winner]], solution.batch[winner], cost)


def views_of(choices: list[Choice]) -> Views:
    """Return the views of a batch that holds each choice once."""
    n_threats = len(choices[0].pair_set)
    return Views(
        np.repeat(np.arange(n_threats), 2),
        np.array([[host for pair in c.pair_set for host in pair] for c in choices]),
        np.array([[c.camera(h, t) for t, pair in enumerate(c.pair_set) for h in pair] for c in choices]),
    )
