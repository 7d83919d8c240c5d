"""What is done for each report and each track, compiled: six numbers a state are too few for array operations.

The steps of all tracks lie side by side (see ``history``): ``times_s`` (n,), ``means`` (n, 6), ``covariances``
(n, 6, 6), ``rows`` (n, ROW) of what was measured and ``before`` (n,), each step's predecessor or -1; of each track
there is a row of ``facts``. Each state is worked on by itself: a batch gives the same bits as its members one by one.
"""

import math

import numpy as np
import numpy.typing as npt

from hsop_gcs.geometry.compiled import kernel

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

TIME, DIMENSIONS, GATE, SIGMA, VARIANCE, MEASURED, VELOCITY_SIGMA, VELOCITY_VARIANCE = 0, 1, 2, 3, 4, 5, 11, 12
"""Where a measurement's row has its time; how many numbers count: 3 (position), 6 (velocity too) or 0 (a bearing); its
gate; the position's standard deviation, 0 if its covariance is given, and its square; position then velocity; the
velocity's standard deviation and its square."""
SIZE, NAMED, CONFIRMS, HINT, COVARIANCE, COMMON, CARRIED, ROW = 13, 14, 15, 16, 17, 26, 35, 44
"""And the threat's size or 0; whether it bears a name; whether it confirms a track at once; one more than the row of
the track that its name stands for, or 0; the position's covariance, row by row, if given; what of it is common to the
next reports, or 0; that part of the step's covariance, of this report or an earlier one; and how long a row is."""
NEWEST, STATUS, VELOCITY_KNOWN, SIZE_M, REPORTS, FIRST_SEEN, FACTS = 0, 1, 2, 3, 4, 5, 6
"""Where a track's facts have its newest step, its status and what ``Track`` says of it; and how many they are."""
PSD, SCAN, COASTS_AFTER, TIMEOUT, TENTATIVE_TIMEOUT, KNOWN_VARIANCE, HITS, SLOTS, SLOT = range(9)
FIRST_VELOCITY, FIRST_CLIMB, FIRST_SIZE, POSITION_LIMIT, VELOCITY_LIMIT, RULES = range(9, 15)
"""Where ``measured.numbers_of`` puts what the kernels need of the rules; and how many they are."""
TENTATIVE, CONFIRMED, COASTING, GONE = 0, 1, 2, 3
FORBIDDEN = 1e9
"""Cost of a pair outside its gate; above any sum of the others."""
SECOND_CHOICE = 1e4
"""Added for a tentative track; above any sum of distances inside gates: confirmed ones come first."""


@kernel
def _predict(
    mean: FloatArray, covariance: FloatArray, t: float, psd: float, d: int, m: FloatArray, p: FloatArray
) -> None:
    """Fill the first d of m (6,) and of p (6, 6) with the state after ``t`` seconds, which may be negative."""
    span = abs(t)
    for i in range(3):
        m[i] = mean[i] + t * mean[i + 3]
        for j in range(3):
            cross = covariance[i, j + 3] + t * covariance[i + 3, j + 3]
            p[i, j] = covariance[i, j] + t * covariance[i + 3, j] + t * cross
            if d > 3:
                p[i, j + 3] = cross
                p[j + 3, i] = cross
                p[i + 3, j + 3] = covariance[i + 3, j + 3]
    for i in range(3):
        p[i, i] += psd * span * span * span / 3
        if d > 3:
            m[i + 3] = mean[i + 3]
            p[i, i + 3] += psd * t * span / 2
            p[i + 3, i] += psd * t * span / 2
            p[i + 3, i + 3] += psd * span


@kernel
def _factor(p: FloatArray, noise: FloatArray, d: int, scale: float, root: FloatArray) -> float:
    """Fill root with the Cholesky factor of S = scale P + R; return log det S, NaN if S is not positive definite."""
    log_det = 0.0
    for i in range(d):
        for j in range(i + 1):
            total = scale * p[i, j] + noise[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            if i > j:
                root[i, j] = total / root[j, j]
            elif total > 0:
                root[i, i] = math.sqrt(total)
                log_det += math.log(total)
            else:
                return math.nan
    return log_det


@kernel
def _squared(m: FloatArray, row: FloatArray, d: int, root: FloatArray, white: FloatArray) -> float:
    """Return r' S^-1 r; white is filled with the residual whitened."""
    squared = 0.0
    for i in range(d):
        total = row[MEASURED + i] - m[i]
        for k in range(i):
            total -= root[i, k] * white[k]
        white[i] = total / root[i, i]
        squared += white[i] * white[i]
    return squared


@kernel
def _spread(row: FloatArray, noise: FloatArray) -> None:
    """Fill noise (6, 6) with the covariance of a report; it is zero already where position meets velocity."""
    for i in range(3):
        noise[i + 3, i + 3] = row[VELOCITY_VARIANCE]
        for j in range(3):
            if row[SIGMA]:
                noise[i, j] = row[VARIANCE] if i == j else 0.0
            else:
                noise[i, j] = row[COVARIANCE + 3 * i + j]


@kernel
def copy(row: FloatArray, to: FloatArray) -> None:
    """Array operations take long to compile."""
    for i in range(ROW):
        to[i] = row[i]


@kernel
def _carry(row: FloatArray, before: FloatArray, to: FloatArray) -> None:
    """Write into a step's row what its covariance has in common with the next ones; before: its predecessor's row."""
    given = row[SIGMA] == 0 and row[COMMON] > 0
    for i in range(9):
        to[CARRIED + i] = row[COMMON + i] if given else before[CARRIED + i]


@kernel
def _begin(row: FloatArray, rules: FloatArray, mean: FloatArray, covariance: FloatArray) -> None:
    """Fill mean and covariance with what one report alone says.

    A velocity it does not give is zero, give or take how fast threats fly.
    """
    for i in range(6):
        mean[i] = row[MEASURED + i]
        for j in range(6):
            covariance[i, j] = 0.0
    _spread(row, covariance)
    for i in range(3):
        sigma_mps = rules[FIRST_CLIMB] if i == 2 else rules[FIRST_VELOCITY]
        if row[DIMENSIONS] == 6:
            sigma_mps = row[VELOCITY_SIGMA]
        covariance[i + 3, i + 3] = sigma_mps * sigma_mps
        if row[SIGMA]:
            covariance[i, i] = row[SIGMA] * row[SIGMA]


@kernel
def correct(
    times_s: FloatArray,
    means: FloatArray,
    covariances: FloatArray,
    rows: FloatArray,
    before: IntArray,
    at: IntArray,
    seen: FloatArray,
    end: int,
    rules: FloatArray,
) -> bool:
    """Add, from step ``end`` on, those that follow steps ``at`` (n,) by the measurements ``seen`` (n, ROW).

    After -1 a track begins. False, and nothing is done, if one of them is a bearing or older than its step. Joseph
    form. As in ``filter.correct``, covariances are doubled until the measurement lies in the gate. What reports have in
    common with each other no number of them betters: it is left out of the filtering, and stays in every covariance
    (Schmidt's filter, for an error that lasts longer than the filter remembers).
    """
    for n in range(len(at)):
        if seen[n, DIMENSIONS] == 0 or (at[n] >= 0 and seen[n, TIME] < times_s[at[n]]):
            return False
    room = np.zeros((7, 6, 6))
    p, root, noise, gain, kept, half = room[0], room[1], room[2], room[3], room[4], room[5]
    m, white = room[6, 0], room[6, 1]
    nothing = np.zeros(ROW)
    for n in range(len(at)):
        row, new = seen[n], end + n
        times_s[new], before[new] = row[TIME], at[n]
        copy(row, rows[new])
        known = nothing if at[n] < 0 else rows[at[n]]
        _carry(row, known, rows[new])
        if at[n] < 0:
            _begin(row, rules, means[new], covariances[new])
            continue
        d = int(row[DIMENSIONS])
        _spread(row, noise)
        _predict(means[at[n]], covariances[at[n]], row[TIME] - times_s[at[n]], rules[PSD], len(m), m, p)
        for i in range(3):
            for j in range(3):
                p[i, j] -= known[CARRIED + 3 * i + j]
        scale = 1.0
        _factor(p, noise, d, scale, root)
        while _squared(m, row, d, root, white) > row[GATE]:
            scale *= 2.0
            _factor(p, noise, d, scale, root)
        for i in range(6):
            for j in range(6):
                p[i, j] *= scale
        for i in range(6):
            # K S = P H': solve with the factor, forwards and back
            for a in range(d):
                total = p[i, a]
                for k in range(a):
                    total -= root[a, k] * gain[i, k]
                gain[i, a] = total / root[a, a]
            for b in range(d):
                a = d - 1 - b
                total = gain[i, a]
                for k in range(a + 1, d):
                    total -= root[k, a] * gain[i, k]
                gain[i, a] = total / root[a, a]
            means[new, i] = m[i]
            for a in range(d):
                means[new, i] += gain[i, a] * (row[MEASURED + a] - m[a])
            for j in range(d):
                kept[i, j] = (1.0 if i == j else 0.0) - gain[i, j]
        # of I - K H all columns past d are those of I
        for i in range(6):
            for j in range(6):
                total = 0.0
                for k in range(d):
                    total += kept[i, k] * p[k, j]
                half[i, j] = total + p[i, j] if i >= d else total
        for i in range(3):
            for j in range(3):
                noise[i, j] -= row[COMMON + 3 * i + j]
        for i in range(6):
            for j in range(i + 1):
                total = 0.0
                for k in range(d):
                    total += half[i, k] * kept[j, k]
                if j >= d:
                    total += half[i, j]
                for a in range(d):
                    for b in range(d):
                        total += gain[i, a] * noise[a, b] * gain[j, b]
                if i < 3:
                    total += rows[new, CARRIED + 3 * i + j]
                covariances[new, i, j] = total
                covariances[new, j, i] = total
    return True


@kernel
def distances(
    times_s: FloatArray, means: FloatArray, covariances: FloatArray, at: IntArray, seen: FloatArray, psd: float
) -> FloatArray:
    """Return the squared distance (n,) of each of n reports from its own step; of a bearing's row 0."""
    squared, room = np.empty(len(at)), np.zeros((4, 6, 6))
    p, root, noise, m, white = room[0], room[1], room[2], room[3, 0], room[3, 1]
    for n in range(len(at)):
        d = int(seen[n, DIMENSIONS])
        _spread(seen[n], noise)
        _predict(means[at[n]], covariances[at[n]], seen[n, TIME] - times_s[at[n]], psd, d, m, p)
        _factor(p, noise, d, 1.0, root)
        squared[n] = _squared(m, seen[n], d, root, white)
    return squared


@kernel
def in_gates(
    times_s: FloatArray,
    means: FloatArray,
    covariances: FloatArray,
    facts: FloatArray,
    seen: FloatArray,
    psd: float,
    scan_s: float,
) -> tuple[FloatArray, IntArray]:
    """Return what it costs to give each measurement to each track, and the pairs of which more must be known.

    Costs, (measurements, tracks + measurements): squared distance plus log det S inside the gate, else ``FORBIDDEN``,
    also to leave it to no track. A late report is held against what is believed now, taken back to its time. Pairs,
    (m, 2): those in their gates whose measurement bears a name, or is not newer than the track's newest by more than
    a scan.
    """
    cost = np.full((len(seen), len(facts) + len(seen)), FORBIDDEN)
    doubtful, doubts, room = np.empty((len(seen) * len(facts), 2), np.int64), 0, np.zeros((4, 6, 6))
    p, root, noise, m, white = room[0], room[1], room[2], room[3, 0], room[3, 1]
    for n in range(len(seen)):
        row = seen[n]
        d = int(row[DIMENSIONS])
        _spread(row, noise)
        noisy = noise[0, 0] + noise[1, 1] + noise[2, 2]
        for track in range(len(facts)):
            at = int(facts[track, NEWEST])
            t = row[TIME] - times_s[at]
            apart, trace = 0.0, noisy + psd * abs(t) ** 3
            for i in range(3):
                apart += (row[MEASURED + i] - means[at, i] - t * means[at, i + 3]) ** 2
                trace += covariances[at, i, i] + t * t * covariances[at, i + 3, i + 3]
                trace += 2 * t * covariances[at, i, i + 3]
            # r' S^-1 r is at least r' r / trace S: most pairs need no more
            if apart > row[GATE] * trace:
                continue
            _predict(means[at], covariances[at], t, psd, d, m, p)
            log_det = _factor(p, noise, d, 1.0, root)
            squared = _squared(m, row, d, root, white)
            if squared <= row[GATE]:
                cost[n, track] = squared + log_det
                if facts[track, STATUS] == TENTATIVE:
                    cost[n, track] += SECOND_CHOICE
                if row[NAMED] or times_s[at] >= row[TIME] - scan_s:
                    doubtful[doubts, 0], doubtful[doubts, 1] = n, track
                    doubts += 1
    return cost, doubtful[:doubts]


@kernel
def assigned(cost: FloatArray) -> IntArray:
    """Return the column (rows,) of each row of ``cost``, none twice, for the least sum; columns are as many or more.

    Shortest augmenting paths, as scipy's ``linear_sum_assignment``, which takes longer to call than this for a few
    rows. Source: Crouse, On implementing 2D rectangular assignment algorithms, 2016.
    """
    count, width = cost.shape
    room, places = np.zeros((3, width)), np.empty((2, width), np.int64)
    of_row, of_column, least, row_at, via = room[0], room[1], room[2], places[0], places[1]
    column_at, reached = np.empty(count, np.int64), np.empty(width, np.bool_)
    for column in range(width):
        row_at[column] = -1
    for start in range(count):
        for other in range(width):
            least[other], reached[other] = np.inf, False
        row, column, length = start, -1, 0.0
        while row >= 0:
            nearest, shortest = -1, np.inf
            for other in range(width):
                if reached[other]:
                    continue
                through = length + cost[row, other] - of_row[row] - of_column[other]
                if through < least[other]:
                    least[other], via[other] = through, column
                if least[other] < shortest or (least[other] == shortest and row_at[other] < 0):
                    nearest, shortest = other, least[other]
            column, length = nearest, shortest
            reached[column], row = True, row_at[column]
        of_row[start] += length
        for other in range(width):
            if reached[other]:
                of_column[other] -= length - least[other]
                if row_at[other] >= 0:
                    of_row[row_at[other]] += length - least[other]
        while column >= 0:
            before = via[column]
            row_at[column] = start if before < 0 else row_at[before]
            column_at[row_at[column]], column = column, before
    return column_at
