"""Reports brought into the local frame, or refused with a reason."""

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import GeodeticPoint, LocalFrame
from hsop_gcs.reports import AltitudeDatum, ReportRules, Site, check_time, locate

FRAME = LocalFrame(GeodeticPoint(lat_deg=47.0, lon_deg=8.0, altitude_amsl_m=400.0))
RULES = ReportRules()
MILLIMETRE = 1e-3


@pytest.mark.parametrize(
    ("datum", "altitude_m"), [(AltitudeDatum.AMSL, 450.0), (AltitudeDatum.AGL, 50.0), (AltitudeDatum.HAE, 498.0)]
)
def test_one_height_in_three_datums_is_one_place(datum: AltitudeDatum, altitude_m: float) -> None:
    site = Site(frame=FRAME, geoid_separation_m=48.0)
    assert locate(47.0, 8.0, altitude_m, datum, site, RULES) == pytest.approx((0, 0, 50), abs=1 * MILLIMETRE)


def test_an_ellipsoid_height_is_refused_where_the_geoid_is_not_known() -> None:
    with pytest.raises(BadInput, match="geoid_separation_m"):
        locate(47.0, 8.0, 498.0, AltitudeDatum.HAE, Site(frame=FRAME), RULES)


@pytest.mark.parametrize(("lat_deg", "lon_deg"), [(0.0, 0.0), (1e-7, -1e-7)])
def test_a_receiver_without_a_fix_is_refused(lat_deg: float, lon_deg: float) -> None:
    with pytest.raises(BadInput, match="no fix"):
        locate(lat_deg, lon_deg, 0.0, AltitudeDatum.AMSL, Site(frame=FRAME), RULES)


def test_a_place_on_the_equator_is_a_place() -> None:
    site = Site(frame=LocalFrame(GeodeticPoint(lat_deg=0.0, lon_deg=32.0, altitude_amsl_m=1100.0)))
    place = locate(0.0, 32.0, 1150.0, AltitudeDatum.AMSL, site, RULES)
    assert place == pytest.approx((0, 0, 50), abs=1 * MILLIMETRE)


def test_a_place_on_another_continent_is_refused() -> None:
    with pytest.raises(BadInput, match="km from the mission"):
        locate(-35.0, 149.0, 500.0, AltitudeDatum.AMSL, Site(frame=FRAME), RULES)


@pytest.mark.parametrize(("offset_s", "word"), [(10.0, "future"), (-60.0, "old")])
def test_times_off_our_clock_are_refused(offset_s: float, word: str) -> None:
    with pytest.raises(BadInput, match=word):
        check_time(1_000_000.0 + offset_s, 1_000_000.0, RULES)


def test_a_time_a_little_ahead_is_a_clock_not_quite_set() -> None:
    check_time(1_000_001.0, 1_000_000.0, RULES)
