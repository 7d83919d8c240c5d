"""Our own aircraft are never threats, and threats beside them are never taken for them."""

import math

import numpy as np
import pytest

from hsop_gcs.reports import Report, Vector3
from hsop_gcs.tracks import Picture, Refusal, RefusalKind, TrackStatus, Verdict, prune, update
from hsop_gcs.tracks.own import OwnAircraft, Path, position_at, remote_id
from tests.tracks.world import RULES, T0_S, after, report

SPEED_MPS = 8.0
UNHEARD = OwnAircraft(unheard=("h1",))


def flight(until_s: float, *, from_s: float = -10.0) -> Path:
    """A host that hovers at the origin, flies east for four seconds, turns north for three and hovers there."""

    def at(time_s: float) -> Vector3:
        east, north = min(max(time_s, 0.0), 4.0), min(max(time_s - 4.0, 0.0), 3.0)
        return (SPEED_MPS * east, SPEED_MPS * north, 40.0)

    corners = [from_s, *(each for each in (0.0, 4.0, 7.0) if each < until_s), until_s]
    return tuple((T0_S + time_s, at(time_s)) for time_s in corners)


def place(time_s: float) -> Vector3:
    return position_at(flight(time_s), T0_S + time_s)


def arrived(
    picture: Picture, now_s: float, *reports: Report, own: OwnAircraft | None = None
) -> tuple[Picture, list[Verdict]]:
    """The picture and the verdicts after reports that arrive together."""
    own = own or OwnAircraft(paths={"h1": flight(now_s)})
    picture, verdicts = update(picture, reports, T0_S + now_s, RULES, own=own)
    return prune(picture, T0_S + now_s, RULES)[0], list(verdicts)


def is_own(verdict: Verdict) -> bool:
    return isinstance(verdict, Refusal) and verdict.kind is RefusalKind.OWN_HOST and verdict.host == "h1"


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize(
    ("late_s", "stamped_late_s"),
    [(0.1, 0.1), (1.2, 1.2), (2.0, 2.0), (6.0, 6.0), (2.0, 0.0), (1.2, 0.0), (0.3, 1.8), (0.3, -1.0)],
    ids=["at once", "Remote ID", "radar", "slow", "radar, stamped on arrival", "ADS-B", "clock behind", "clock ahead"],
)
def test_what_a_late_source_says_of_a_host_begins_no_threat(late_s: float, stamped_late_s: float, named: bool) -> None:
    """late_s: how old the place is that is told; stamped_late_s: how old it is by the report's time."""
    picture = Picture()
    for step in range(60):
        now_s = step / 4
        told = report(now_s - stamped_late_s, *place(now_s - late_s), threat_id="OWN1" if named else None, sigma_m=3.0)
        picture, (verdict,) = arrived(picture, now_s, told)
        assert is_own(verdict), now_s
    assert not picture.tracks
    assert picture.sources["radar"].refused == {RefusalKind.OWN_HOST: 60}


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("towards", ["a host that hovers", "a host that flies the other way"])
@pytest.mark.parametrize("sigma_m", [1.0, 3.0, 6.0])
def test_a_threat_that_flies_past_a_host_stays_tracked(sigma_m: float, towards: str, named: bool) -> None:
    """At 6 m, with the host's own plot in every scan of the same radar."""
    host_mps = 0.0 if towards == "a host that hovers" else -6.0
    picture, seen = Picture(), 0
    for step in range(80):
        now_s = step / 4
        here = (host_mps * (now_s - 10.0), 0.0, 40.0)
        own = OwnAircraft(paths={"h1": ((T0_S - 5.0, (host_mps * -15.0, 0.0, 40.0)), (T0_S + now_s, here))})
        threat = report(now_s, 5.0 * (now_s - 10.0), 6.0, threat_id="t1" if named else None, sigma_m=sigma_m)
        plot = report(now_s, *here, threat_id=None, sigma_m=sigma_m)
        picture, (ours, theirs) = arrived(picture, now_s, plot, threat, own=own)
        assert is_own(ours), now_s
        seen += not isinstance(theirs, Refusal)
        assert len(picture.tracks) <= 1
    (track,) = picture.tracks.values()
    assert math.dist(track.position_m, (5.0 * 9.75, 6.0, 40.0)) < 3.0
    assert seen == 80 if named else seen >= 70


def test_a_threat_that_is_lost_beside_a_host_does_not_go_on_as_that_host() -> None:
    """The radar's plots of the host lie in the gate of the threat, which has landed there."""
    own = OwnAircraft.at_rest({"h1": (0.0, 0.0, 40.0)})
    picture = after(*(report(step / 4, -20.0 + step, 0.0, threat_id=None) for step in range(16)))
    picture, _ = arrived(picture, 4.0, report(4.0, -4.0, 0.0, threat_id=None), own=own)
    assert len(picture.tracks) == 1
    for step in range(1, 60):
        now_s = 4.0 + step / 4
        picture, (verdict,) = arrived(picture, now_s, report(now_s, 0.0, 0.0, threat_id=None), own=own)
    assert not picture.tracks
    assert is_own(verdict)


def test_what_began_as_a_threat_while_a_host_was_not_heard_is_let_go_once_it_is() -> None:
    picture = Picture()
    for step in range(60):
        now_s = step / 4
        own = UNHEARD if now_s < 3.0 else OwnAircraft(paths={"h1": flight(now_s)})
        told = report(now_s - 1.2, *place(now_s - 1.2), threat_id="OWN1", sigma_m=3.0)
        picture, (verdict,) = arrived(picture, now_s, told, own=own)
        assert is_own(verdict) == (now_s >= 4.0) or 3.0 <= now_s < 4.0
    assert not picture.tracks


def test_a_threat_that_began_while_a_host_was_not_heard_is_one_once_it_was_seen_apart() -> None:
    picture = Picture()
    own = OwnAircraft.at_rest({"h1": (50.0, 0.0, 40.0)})
    for step in range(40):
        now_s = step / 4
        picture, (verdict,) = arrived(picture, now_s, report(now_s, 5.0 * now_s), own=UNHEARD if now_s < 2.0 else own)
        assert verdict == "t1"
    assert picture.tracks["t1"].not_apart == frozenset()


def test_a_source_that_gives_a_host_an_id_for_the_first_time_beside_a_threat_does_not_bind_it_to_that() -> None:
    own = OwnAircraft.at_rest({"h1": (0.0, 6.0, 40.0)})
    picture = after(*(report(step / 4, -20.0 + 1.25 * step) for step in range(16)))
    picture, (verdict,) = arrived(picture, 4.0, report(4.0, 0.0, 4.0, source="rid", threat_id="OWN1"), own=own)
    assert is_own(verdict)
    assert [each.threat_id for each in picture.tracks["t1"].sources] == ["t1"]


@pytest.mark.parametrize(
    ("velocity_mps", "own"),
    [(None, True), ((8.0, 0.0, 0.0), True), ((-5.0, 4.0, 0.0), False), ((0.0, 0.0, 0.0), False)],
)
def test_what_crosses_the_way_a_host_has_flown_is_a_threat_if_its_velocity_says_so(
    velocity_mps: Vector3 | None, own: bool
) -> None:
    behind = place(1.5)
    told = report(3.0, *behind, threat_id="new", velocity_mps=velocity_mps)
    _, (verdict,) = arrived(Picture(), 3.0, told)
    assert is_own(verdict) == own


def test_where_a_host_was_long_ago_threats_begin() -> None:
    _, (verdict,) = arrived(Picture(), 6.0, report(6.0, *place(2.0), threat_id="new"))
    assert verdict == "new"


@pytest.mark.parametrize(("sigma_m", "rate_hz"), [(2.0, 4), (3.0, 4), (6.0, 1), (6.0, 4), (10.0, 1)])
def test_noise_makes_no_confirmed_threat_of_a_host(sigma_m: float, rate_hz: int) -> None:
    """What of its plots falls outside any radius begins tracks, which are confirmed only once they are surely apart."""
    rng, picture = np.random.default_rng(7), Picture()
    for step in range(40 * rate_hz):
        now_s = step / rate_hz
        at = place(now_s - 1.2) + sigma_m * rng.standard_normal(3)
        picture, _ = arrived(picture, now_s, report(now_s - 1.2, *at.tolist(), threat_id="OWN1", sigma_m=sigma_m))
        assert all(track.status is TrackStatus.TENTATIVE for track in picture.tracks.values())


def test_a_coarse_threat_that_begins_near_a_host_is_confirmed_once_its_reports_show_it_apart() -> None:
    rng, picture = np.random.default_rng(3), Picture()
    own, confirmed_s = OwnAircraft.at_rest({"h1": (0.0, 0.0, 40.0)}), math.inf
    for now_s in range(60):
        at = (26.0, 0.0, 40.0) + 10.0 * rng.standard_normal(3)
        told = report(now_s, *at.tolist(), sigma_m=10.0)
        picture, _ = arrived(picture, now_s, told, own=own)
        if any(track.status is TrackStatus.CONFIRMED for track in picture.tracks.values()):
            confirmed_s = min(confirmed_s, now_s)
    assert confirmed_s < 20.0
    assert set(picture.tracks) == {"t1"}


def test_ids_are_compared_without_case_and_blanks() -> None:
    assert remote_id(" 1581f 4XQ\t") == remote_id("1581F4xq")
