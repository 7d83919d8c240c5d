"""What is done for each track, compiled: its steps (see ``history``) and its facts (see ``lifecycle``)."""

import numpy as np

from hsop_gcs.tracks.kernels import (
    COASTING,
    CONFIRMED,
    CONFIRMS,
    DIMENSIONS,
    FACTS,
    FIRST_SEEN,
    FORBIDDEN,
    GONE,
    NAMED,
    NEWEST,
    REPORTS,
    ROW,
    SIZE,
    SIZE_M,
    STATUS,
    TENTATIVE,
    TIME,
    VELOCITY_KNOWN,
    FloatArray,
    IntArray,
    assigned,
    begin,
    copy,
    correct,
    distances,
    in_gates,
    kernel,
)

Life = tuple[float, float, float, float, float, float]
"""What a track's life depends on: the time now, after how long it coasts, below which variance its velocity is known,
and how many of the newest slots of time, of what length, must hold a measurement to confirm it."""


@kernel
def step_at(times_s: FloatArray, before: IntArray, newest: int, time_s: float, memory_s: float) -> int:
    """Return the newest step of a track not after ``time_s``, or the oldest that is remembered."""
    at = newest
    while times_s[at] > time_s and before[at] >= 0 and times_s[at] >= times_s[newest] - memory_s:
        at = before[at]
    return at


@kernel
def remembered(
    times_s: FloatArray, before: IntArray, newest: IntArray, memory_s: float
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the steps (n,) that tracks remember, where each has its predecessor among these, and the newest ones.

    Those of the last ``memory_s`` of each track and one older.
    """
    count = 0
    for track in range(len(newest)):
        oldest = step_at(times_s, before, newest[track], -np.inf, memory_s)
        count, at = count + 1, newest[track]
        while at != oldest:
            count, at = count + 1, before[at]
    kept, follows, places = np.empty(count, np.int64), np.full(count, -1), np.empty_like(newest)
    count = 0
    for track in range(len(newest)):
        oldest = step_at(times_s, before, newest[track], -np.inf, memory_s)
        places[track], at = count, newest[track]
        while at != oldest:
            kept[count], follows[count] = at, count + 1
            count, at = count + 1, before[at]
        kept[count] = oldest
        count += 1
    return kept, follows, places


@kernel
def has_left(status: int, newest_s: float, now_s: float, tentative_timeout_s: float, timeout_s: float) -> bool:
    """Return whether nothing has come of a track for so long that it is over."""
    return now_s - newest_s > (min(tentative_timeout_s, timeout_s) if status == TENTATIVE else timeout_s)


@kernel
def _alive(newest_s: float, now_s: float, coast_after_s: float) -> int:
    return COASTING if now_s - newest_s > coast_after_s else CONFIRMED


@kernel
def age(
    times_s: FloatArray,
    facts: FloatArray,
    now_s: float,
    coast_after_s: float,
    tentative_timeout_s: float,
    timeout_s: float,
) -> bool:
    """Bring statuses to what they are at ``now_s``; return whether any has changed."""
    changed = False
    for track in range(len(facts)):
        newest_s, status = times_s[int(facts[track, NEWEST])], int(facts[track, STATUS])
        now = status
        if has_left(status, newest_s, now_s, tentative_timeout_s, timeout_s):
            now = GONE
        elif status != TENTATIVE:
            now = _alive(newest_s, now_s, coast_after_s)
        facts[track, STATUS] = now
        changed |= now != status
    return changed


@kernel
def live(
    times_s: FloatArray,
    covariances: FloatArray,
    before: IntArray,
    facts: FloatArray,
    tracks: IntArray,
    newest: IntArray,
    seen: FloatArray,
    life: Life,
) -> int:
    """Write down what each of n measurements, which led to step ``newest``, means for its track.

    Return how many were older than their track's newest before.
    """
    now_s, coast_after_s, known_variance_m2ps2, hits, slots, slot_s = life
    late = 0
    for n in range(len(tracks)):
        fact, row, at = facts[tracks[n]], seen[n], newest[n]
        newest_s, variance = times_s[at], covariances[at]
        late += row[TIME] < times_s[int(fact[NEWEST])]
        fact[NEWEST] = at
        fact[REPORTS] += 1
        fact[FIRST_SEEN] = min(fact[FIRST_SEEN], row[TIME])
        fact[VELOCITY_KNOWN] = (variance[3, 3] + variance[4, 4] + variance[5, 5]) / 3 <= known_variance_m2ps2
        if row[SIZE] != 0:
            fact[SIZE_M] = row[SIZE]
        if fact[STATUS] != TENTATIVE or row[CONFIRMS] or _in_slots(times_s, before, at, slots, slot_s) >= hits:
            fact[STATUS] = _alive(newest_s, now_s, coast_after_s)
    return late


@kernel
def _in_slots(times_s: FloatArray, before: IntArray, newest: int, slots: float, slot_s: float) -> int:
    """Return how many of a track's newest slots of time hold a measurement."""
    count, last, at = 0, -1, newest
    while at >= 0:
        slot = int(np.rint((times_s[newest] - times_s[at]) / slot_s))
        if slot >= slots:
            break
        count += slot != last
        last, at = slot, before[at]
    return count


@kernel
def take(
    times_s: FloatArray,
    means: FloatArray,
    covariances: FloatArray,
    rows: FloatArray,
    before: IntArray,
    facts: FloatArray,
    seen: FloatArray,
    end: int,
    psd: float,
    scan_s: float,
    life: Life,
) -> IntArray:
    """Tell tracks what the reports of a scan say; return the row of the track of each (n,), -1 for none.

    Nothing is done, and (0,) returned, if there is more to weigh than distances: names, bearings, and what is not newer
    than a track by more than a scan.
    """
    nothing = np.empty(0, np.int64)
    for n in range(len(seen)):
        if seen[n, DIMENSIONS] == 0 or seen[n, NAMED]:
            return nothing
    cost, doubtful = in_gates(times_s, means, covariances, facts, seen, psd, scan_s)
    if len(doubtful):
        return nothing
    tracks, of, at = assigned(cost), np.empty(len(seen), np.int64), np.empty(len(seen), np.int64)
    told, count = np.empty_like(seen), 0
    for n in range(len(seen)):
        if cost[n, tracks[n]] == FORBIDDEN:
            tracks[n] = -1
        else:
            of[count], at[count] = tracks[n], int(facts[tracks[n], NEWEST])
            copy(seen[n], told[count])
            count += 1
    correct(times_s, means, covariances, rows, before, at[:count], told, end, psd)
    for n in range(count):
        at[n] = end + n
    live(times_s, covariances, before, facts, of[:count], at, told, life)
    return tracks


def warm_up() -> None:
    """Compile everything, or load it from the cache."""
    state = np.zeros(2), np.zeros((2, 6)), np.stack([np.eye(6)] * 2)
    log = *state, np.zeros((2, ROW)), -np.ones(2, np.int64)
    first, seen, facts = np.zeros(1, np.int64), np.ones((1, ROW)), np.zeros((1, FACTS))
    seen[0, DIMENSIONS], life = 3, (1.0,) * 6
    begin(*log, seen, 0, 1.0, 1.0)
    correct(*log, first, seen, 1, 1.0)
    distances(*state, first, seen, 1.0)
    assigned(in_gates(*state, facts, seen, 1.0, 1.0)[0])
    step_at(log[0], log[4], 1, 0.0, 1.0)
    remembered(log[0], log[4], first, 1.0)
    live(log[0], log[2], log[4], facts, first, first, seen, life)
    age(log[0], facts, 0.0, 1.0, 1.0, 1.0)
    has_left(TENTATIVE, 0.0, 0.0, 1.0, 1.0)
    take(*log, facts, seen, 1, 1.0, 1.0, life)
