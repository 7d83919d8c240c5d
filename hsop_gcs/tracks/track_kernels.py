"""What is done for each track, compiled: its steps (see ``history``) and its facts (see ``lifecycle``)."""

import numpy as np

from hsop_gcs.geometry.compiled import kernel
from hsop_gcs.tracks.kernels import (
    COASTING,
    COASTS_AFTER,
    CONFIRMED,
    CONFIRMS,
    COVARIANCE,
    DIMENSIONS,
    FACTS,
    FIRST_SEEN,
    FIRST_SIZE,
    FORBIDDEN,
    GONE,
    HINT,
    HITS,
    KNOWN_VARIANCE,
    MEASURED,
    NEWEST,
    POSITION_LIMIT,
    PSD,
    REPORTS,
    ROW,
    RULES,
    SCAN,
    SIGMA,
    SIZE,
    SIZE_M,
    SLOT,
    SLOTS,
    STATUS,
    TENTATIVE,
    TENTATIVE_TIMEOUT,
    TIME,
    TIMEOUT,
    VELOCITY_KNOWN,
    VELOCITY_LIMIT,
    FloatArray,
    IntArray,
    assigned,
    copy,
    correct,
    distances,
    in_gates,
)


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
def status_at(status: int, newest_s: float, now_s: float, rules: FloatArray) -> int:
    """Return what a track of a status is at ``now_s`` if nothing new comes."""
    silent_s = now_s - newest_s
    if status == TENTATIVE:
        return GONE if silent_s > min(rules[TENTATIVE_TIMEOUT], rules[TIMEOUT]) else TENTATIVE
    if silent_s > rules[TIMEOUT]:
        return GONE
    return COASTING if silent_s > rules[COASTS_AFTER] else CONFIRMED


@kernel
def is_aged(times_s: FloatArray, facts: FloatArray, now_s: float, rules: FloatArray) -> bool:
    """Whether any track has another status at ``now_s`` than its facts (tracks, FACTS) say."""
    changed = False
    for fact in facts:
        changed |= status_at(int(fact[STATUS]), times_s[int(fact[NEWEST])], now_s, rules) != fact[STATUS]
    return changed


@kernel
def aged(
    times_s: FloatArray, facts: FloatArray, now_s: float, rules: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return the facts of the tracks that are left at ``now_s``, the rows of the others, and when these were heard."""
    left, gone, heard_s = np.empty_like(facts), np.empty(len(facts), np.int64), np.empty(len(facts))
    stay = leave = 0
    for track in range(len(facts)):
        newest_s = times_s[int(facts[track, NEWEST])]
        status = status_at(int(facts[track, STATUS]), newest_s, now_s, rules)
        if status == GONE:
            gone[leave], heard_s[leave] = track, newest_s
            leave += 1
        else:
            for i in range(FACTS):
                left[stay, i] = facts[track, i]
            left[stay, STATUS] = status
            stay += 1
    return left[:stay], gone[:leave], heard_s[:leave]


@kernel
def live(
    times_s: FloatArray,
    covariances: FloatArray,
    before: IntArray,
    facts: FloatArray,
    tracks: IntArray,
    newest: IntArray,
    seen: FloatArray,
    now_s: float,
    rules: FloatArray,
) -> int:
    """Write down what each of n measurements, which led to step ``newest``, means for its track.

    Return how many were older than their track's newest before.
    """
    late = 0
    for n in range(len(tracks)):
        fact, row, at = facts[tracks[n]], seen[n], newest[n]
        newest_s, variance = times_s[at], covariances[at]
        late += fact[NEWEST] >= 0 and row[TIME] < times_s[int(fact[NEWEST])]
        fact[NEWEST] = at
        fact[REPORTS] += 1
        fact[FIRST_SEEN] = min(fact[FIRST_SEEN], row[TIME])
        fact[VELOCITY_KNOWN] = (variance[3, 3] + variance[4, 4] + variance[5, 5]) / 3 <= rules[KNOWN_VARIANCE]
        if row[SIZE] != 0:
            fact[SIZE_M] = row[SIZE]
        hits = _in_slots(times_s, before, at, rules[SLOTS], rules[SLOT]) if fact[STATUS] == TENTATIVE else 0
        if fact[STATUS] != TENTATIVE or row[CONFIRMS] or hits >= rules[HITS]:
            fact[STATUS] = COASTING if now_s - newest_s > rules[COASTS_AFTER] else CONFIRMED
    return late


@kernel
def unknown(fact: FloatArray, rules: FloatArray) -> None:
    """Fill the facts of a track that has not been told anything."""
    fact[NEWEST], fact[STATUS], fact[VELOCITY_KNOWN], fact[REPORTS] = -1, TENTATIVE, 0, 0
    fact[SIZE_M], fact[FIRST_SEEN] = rules[FIRST_SIZE], np.inf


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
def _plain(seen: FloatArray, now_s: float, max_future_s: float, max_age_s: float, rules: FloatArray) -> bool:
    """Whether measurements are reports of one scan, in order, that nothing can be said against: see ``screen``."""
    for n in range(len(seen)):
        row = seen[n]
        time_s = row[TIME]
        if row[DIMENSIONS] == 0 or row[SIGMA] == 0 or not now_s - max_age_s <= time_s <= now_s + max_future_s:
            return False
        if time_s < seen[max(n - 1, 0), TIME] or time_s > seen[0, TIME] + rules[SCAN]:
            return False
        for i in range(COVARIANCE):
            if not np.isfinite(row[i]):
                return False
        for other in range(n):
            if seen[other, MEASURED] == row[MEASURED] and seen[other, MEASURED + 1] == row[MEASURED + 1]:
                return False
    return True


@kernel
def take(
    times_s: FloatArray,
    means: FloatArray,
    covariances: FloatArray,
    rows: FloatArray,
    before: IntArray,
    facts: FloatArray,
    then: FloatArray,
    seen: FloatArray,
    tracks: IntArray,
    end: int,
    now_s: float,
    max_future_s: float,
    max_age_s: float,
    rules: FloatArray,
) -> int:
    """Tell tracks what the reports of a scan say, and begin tracks with those that are of none.

    ``facts``: of the tracks there are; ``then``, with room for as many more as there are reports, is filled with what
    they are afterwards. ``tracks`` (n,) is filled with the row of the track of each, and steps from ``end`` on are what
    follows from them, in the same order. Returns how many tracks there are then; -1, and no track is changed, if there
    is more to weigh than distances: what ``_plain`` refuses, names that are not followed at once, and what is not newer
    than a track by more than a scan.
    """
    if not _plain(seen, now_s, max_future_s, max_age_s, rules):
        return -1
    known = len(facts)
    at, taken, free = np.full(len(seen), -1), np.zeros(known, np.bool_), np.empty_like(seen)
    count = 0
    for n in range(len(seen)):
        tracks[n] = int(seen[n, HINT]) - 1
        if tracks[n] < 0:
            copy(seen[n], free[count])
            count += 1
            continue
        taken[tracks[n]], at[n] = True, int(facts[tracks[n], NEWEST])
        if seen[n, TIME] <= times_s[at[n]]:
            return -1
    if count < len(seen):
        squared = distances(times_s, means, covariances, at, seen, rules[PSD])
        for n in range(len(seen)):
            limit = rules[POSITION_LIMIT if seen[n, DIMENSIONS] == 3 else VELOCITY_LIMIT]
            if at[n] >= 0 and not squared[n] < limit:
                return -1
    cost, doubtful = in_gates(times_s, means, covariances, facts, free[:count], rules[PSD], rules[SCAN])
    for pair in range(len(doubtful)):
        if not taken[doubtful[pair, 1]]:
            return -1
    for n in range(count):
        for track in range(known):
            if taken[track]:
                cost[n, track] = FORBIDDEN
    for track in range(known):
        for i in range(FACTS):
            then[track, i] = facts[track, i]
    nearest, total, count = assigned(cost), known, 0
    for n in range(len(seen)):
        if tracks[n] >= 0:
            continue
        if cost[count, nearest[count]] < FORBIDDEN:
            tracks[n] = nearest[count]
            at[n] = int(facts[tracks[n], NEWEST])
        else:
            tracks[n] = total
            unknown(then[total], rules)
            total += 1
        count += 1
    correct(times_s, means, covariances, rows, before, at, seen, end, rules)
    for n in range(len(seen)):
        at[n] = end + n
    live(times_s, covariances, before, then, tracks, at, seen, now_s, rules)
    return total


def warm_up() -> None:
    """Compile everything, or load it from the cache."""
    state = np.zeros(2), np.zeros((2, 6)), np.stack([np.eye(6)] * 2)
    log = *state, np.zeros((2, ROW)), -np.ones(2, np.int64)
    first, seen, facts, rules = np.zeros(1, np.int64), np.ones((1, ROW)), np.zeros((2, FACTS)), np.ones(RULES)
    seen[0, DIMENSIONS] = 3
    correct(*log, first, seen, 1, rules)
    distances(*state, first, seen, 1.0)
    assigned(in_gates(*state, facts, seen, 1.0, 1.0)[0])
    step_at(log[0], log[4], 1, 0.0, 1.0)
    remembered(log[0], log[4], first, 1.0)
    live(log[0], log[2], log[4], facts, first, first, seen, 1.0, rules)
    is_aged(log[0], facts, 0.0, rules)
    aged(log[0], facts, 0.0, rules)
    status_at(TENTATIVE, 0.0, 0.0, rules)
    unknown(facts[0], rules)
    take(*log, facts[:1], facts, seen, first, 1, 1.0, 1.0, 1.0, rules)
