"""Message signing: held against pymavlink's own, and against forgers."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.link.codec import Decoder, Encoder, message_ids
from hsop_gcs.link.endpoint import Peer
from hsop_gcs.link.enums import MavAutopilot, MavType
from hsop_gcs.link.events import AddressRegistered, LinkLost, LinkUp
from hsop_gcs.link.key_files import TimestampFile, read_key
from hsop_gcs.link.messages import Attitude, Heartbeat, Message
from hsop_gcs.link.router import Router
from hsop_gcs.link.signing import TICKS_PER_S, Signing, SigningClock, Verdict
from tests.link.strategies import spoken

KEY, OTHER_KEY = bytes(range(32)), bytes(32)
NOON_UNIX_S = 1_800_000_000.0
NOON = round((NOON_UNIX_S - 1_420_070_400) * TICKS_PER_S)
HERE, THERE = Peer(0, "127.0.0.1", 14541), Peer(0, "127.0.0.1", 14542)
BEAT = Heartbeat(type=MavType.QUADROTOR, autopilot=MavAutopilot.PX4)


class Wall:
    """A clock that stands until it is moved."""

    def __init__(self, unix_s: float = NOON_UNIX_S) -> None:
        self.unix_s = unix_s

    def __call__(self) -> float:
        return self.unix_s


def signing(key: bytes = KEY, wall: Wall | None = None, **changes: Any) -> Signing:
    return Signing(key, clock=SigningClock(wall or Wall()), **changes)


class Vehicle:
    """Something that signs, with a clock of its own."""

    def __init__(self, key: bytes = KEY, *, system: int = 1, component: int = 1, link_id: int = 0) -> None:
        self.wall = Wall()
        signer = signing(key, self.wall, link_id=link_id)
        self._encoder = Encoder(system=system, component=component, sign=signer.sign)

    def __call__(self, message: Message = BEAT, *, at_s: float = 0.0) -> bytes:
        """Return a signed frame, dated so many seconds after noon."""
        self.wall.unix_s = NOON_UNIX_S + at_s
        return self._encoder.encode(message)


def pymavlink(key: bytes = KEY) -> Any:
    """A peer whose signing is pymavlink's."""
    mav = dialect.MAVLink(None, srcSystem=7, srcComponent=3)
    mav.signing.secret_key = key
    mav.signing.sign_outgoing = True
    mav.signing.link_id = 5
    mav.signing.timestamp = NOON
    return mav


@settings(max_examples=100, deadline=None)
@given(spoken())
def test_pymavlink_believes_what_we_sign_and_only_with_the_same_key(message: Message) -> None:
    raw = Encoder(system=1, component=1, sign=signing().sign).encode(message)
    assert pymavlink().decode(bytearray(raw)).get_msgId() == message.ID
    with pytest.raises(dialect.MAVError, match="signature"):
        pymavlink(OTHER_KEY).decode(bytearray(raw))
    (frame,) = Decoder().feed_datagram(raw)
    assert frame.raw == raw


def test_we_believe_what_pymavlink_signs_and_only_with_the_same_key() -> None:
    raw = dialect.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0).pack(pymavlink())
    assert signing().judge(raw) is Verdict.GENUINE
    assert signing(OTHER_KEY).judge(raw) is Verdict.FORGED


def test_every_changed_bit_is_seen() -> None:
    raw = Vehicle()()
    for bit in range(8, 8 * len(raw)):
        changed = bytearray(raw)
        changed[bit // 8] ^= 1 << bit % 8
        assert signing().judge(bytes(changed)) in (Verdict.FORGED, Verdict.UNSIGNED)


def test_a_forgery_from_the_future_harms_nobody() -> None:
    """pymavlink 2.4.50 remembers the date before it looks at the hash: one such frame shuts the vehicle out."""
    ours, vehicle, forger = signing(), Vehicle(), Vehicle(OTHER_KEY)
    assert ours.judge(vehicle()) is Verdict.GENUINE
    assert ours.judge(forger(at_s=500.0)) is Verdict.FORGED
    assert ours.judge(vehicle(at_s=0.1)) is Verdict.GENUINE


def test_forgers_fill_no_table_and_push_nobody_out() -> None:
    ours, vehicle = signing(), Vehicle()
    old = vehicle()
    assert ours.judge(old) is Verdict.GENUINE
    for number in range(5000):
        forger = Vehicle(OTHER_KEY, system=1 + number % 250, component=number // 250, link_id=number % 7)
        assert ours.judge(forger()) is Verdict.FORGED
    assert ours.judge(old) is Verdict.REPLAYED
    assert len(ours._streams) == 1


def test_streams_of_one_key_have_a_bound_as_well() -> None:
    ours = signing()
    for number in range(3000):
        fellow = Vehicle(system=1 + number % 250, component=number // 250)
        assert ours.judge(fellow()) is Verdict.GENUINE
    assert len(ours._streams) <= 1024


def test_a_frame_counts_once_and_may_be_overtaken_but_not_by_long() -> None:
    ours, vehicle = signing(), Vehicle()
    first, second, third = (vehicle(at_s=at_s) for at_s in (0.0, 0.1, 0.2))
    late = vehicle(at_s=0.3)
    assert [ours.judge(raw) for raw in (first, third, second)] == [Verdict.GENUINE] * 3
    assert [ours.judge(raw) for raw in (first, second, third)] == [Verdict.REPLAYED] * 3
    assert ours.judge(vehicle(at_s=10.0)) is Verdict.GENUINE
    assert ours.judge(late) is Verdict.REPLAYED


def test_many_frames_later_an_old_one_is_not_new_again() -> None:
    ours, vehicle = signing(), Vehicle()
    kept_back, *sent = (vehicle(at_s=number / 1000) for number in range(1000))
    assert all(ours.judge(raw) is Verdict.GENUINE for raw in sent)
    assert ours.judge(kept_back) is Verdict.REPLAYED
    assert len(ours._streams[(1, 1, 0)].seen) <= 128


def test_a_genuine_frame_from_the_future_is_refused_and_drags_our_clock_along_by_minutes_at_most() -> None:
    wall = Wall()
    clock = SigningClock(wall)
    ours = Signing(KEY, clock=clock)
    assert ours.judge(Vehicle()(at_s=3600.0)) is Verdict.FUTURE
    assert clock.next() <= NOON + 1
    assert ours.judge(Vehicle()(at_s=300.0)) is Verdict.GENUINE
    # A vehicle takes nothing from us that is dated before its own frames.
    assert clock.next() > NOON + 300 * TICKS_PER_S


def test_a_stream_that_begins_in_the_past_is_stale() -> None:
    ours, vehicle = signing(), Vehicle()
    assert ours.judge(vehicle(at_s=-61.0)) is Verdict.STALE
    assert ours.judge(vehicle(at_s=-50.0)) is Verdict.GENUINE


def test_unsigned_frames_pass_only_if_their_message_may_and_a_bad_signature_is_worse_than_none() -> None:
    ours = signing(allow_unsigned=message_ids(["RADIO_STATUS"]))
    radio = dialect.MAVLink(None, srcSystem=51, srcComponent=68)
    status = dialect.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
    assert ours.judge(status.pack(radio)) is Verdict.ALLOWED
    assert ours.judge(status.pack(radio, force_mavlink1=True)) is Verdict.ALLOWED
    assert ours.judge(Encoder(system=1, component=1).encode(BEAT)) is Verdict.UNSIGNED
    assert ours.judge(status.pack(pymavlink(OTHER_KEY))) is Verdict.FORGED
    with pytest.raises(ValueError, match="'RADIO_GAGA' is no MAVLink message"):
        message_ids(["RADIO_GAGA"])


def test_timestamps_rise_with_the_wall_and_over_a_restart_with_a_wrong_clock(tmp_path: Path) -> None:
    wall, store = Wall(), TimestampFile(tmp_path / "timestamp")
    clock = SigningClock(wall, saved=store.load(), save=store.save)
    stamps = [clock.next() for _ in range(100)]
    wall.unix_s += 60.0
    stamps.append(clock.next())
    assert stamps == sorted(set(stamps))
    assert stamps[-1] == NOON + 60 * TICKS_PER_S
    again = SigningClock(Wall(NOON_UNIX_S - 86_400.0), saved=store.load(), save=store.save)
    assert stamps[-1] < again.next() <= stamps[-1] + 11 * TICKS_PER_S


def test_timestamps_that_cannot_be_saved_are_a_problem_and_no_crash(tmp_path: Path) -> None:
    store = TimestampFile(tmp_path / "gone" / "timestamp")
    clock = SigningClock(Wall(), saved=store.load(), save=store.save)
    assert clock.next() == NOON
    assert clock.problem == "signing timestamps cannot be saved: No such file or directory"
    (tmp_path / "timestamp").write_text("yesterday")
    with pytest.raises(Unavailable, match="signing timestamps: cannot read"):
        TimestampFile(tmp_path / "timestamp").load()


@pytest.mark.parametrize("content", [KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\n"])
def test_a_key_is_read_from_bytes_or_digits(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "fleet.key"
    path.write_bytes(content)
    path.chmod(0o600)
    assert read_key(path) == KEY


@pytest.mark.parametrize(
    ("content", "mode", "problem"),
    [
        (KEY, 0o644, r"is open to others \(mode 0644\): chmod 600 it"),
        (KEY, 0o620, "is open to others"),
        (KEY[:-1], 0o600, "is no key: neither 32 bytes nor 64 hex digits"),
        (KEY.hex().encode()[:-2], 0o600, "is no key"),
        (b"\xff" * 64, 0o600, "is no key"),
        (KEY * 100, 0o600, "is no key"),
        (None, 0o600, "cannot read .*: No such file"),
    ],
)
def test_a_key_file_that_is_none_or_open_to_others_is_refused(
    tmp_path: Path, content: bytes | None, mode: int, problem: str
) -> None:
    path = tmp_path / "fleet.key"
    if content is not None:
        path.write_bytes(content)
        path.chmod(mode)
    with pytest.raises(BadInput, match=f"^key_file: .*{problem}"):
        read_key(path)


def heartbeats(router: Router) -> list[Peer]:
    return [
        peer
        for peer, raw in router.take_outgoing()
        for frame in Decoder().feed_datagram(raw)
        if isinstance(frame.message, Heartbeat)
    ]


def test_a_signed_link_hears_and_records_only_genuine_frames_and_counts_the_rest() -> None:
    router = Router([1], signing={0: signing()})
    raw = Vehicle()()
    forged, unsigned = Vehicle(OTHER_KEY)(at_s=1.0), Encoder(system=1, component=1).encode(BEAT)
    believed = [len(router.receive(data, HERE, 0.0)) for data in (forged, unsigned, raw, raw, unsigned)]
    assert believed == [0, 0, 1, 0, 0]
    link = router.vehicle_link(1, 0.0)
    assert link.signature_refused == {"forged": 1, "unsigned": 2, "replayed": 1}
    assert router.counters.signature_refused == link.signature_refused
    assert (link.received, link.refused, link.lost) == (1, 0, 0)
    router.advance(0.0)
    assert all(signing().judge(sent) is Verdict.GENUINE for _, sent in router.take_outgoing())


def test_a_vehicle_without_a_clock_is_greeted_so_that_it_may_take_the_date_from_us() -> None:
    router, vehicle = Router([1], signing={0: signing()}), Vehicle()
    router.receive(vehicle(at_s=-86_400.0), HERE, 0.0)
    router.receive(Vehicle(OTHER_KEY)(at_s=-86_400.0), THERE, 0.0)
    router.advance(0.0)
    assert heartbeats(router) == [HERE]
    router.receive(vehicle(), HERE, 0.5)
    assert router.take_events() == [LinkUp(system=1)]
    router.advance(10.0)
    router.receive(Vehicle(system=2)(at_s=-86_400.0), THERE, 10.0)
    router.advance(11.0)
    assert set(heartbeats(router)) == {HERE}


def test_a_signature_registers_a_new_address_once_the_link_is_lost_and_says_so() -> None:
    router, vehicle = Router([1], signing={0: signing()}), Vehicle()
    router.receive(vehicle(), HERE, 0.0)
    router.receive(vehicle(at_s=1.0), THERE, 1.0)
    assert router.vehicle_link(1, 1.0).refused == 1
    router.receive(vehicle(Attitude(), at_s=9.0), THERE, 9.0)
    assert router.vehicle_link(1, 9.0).peer == HERE
    router.receive(vehicle(at_s=10.0), THERE, 10.0)
    _, *events = router.take_events()
    assert AddressRegistered(system=1, address="127.0.0.1:14542", before="127.0.0.1:14541", by="signature") in events
    assert [type(event) for event in events if isinstance(event, LinkUp | LinkLost)] == [LinkUp, LinkLost, LinkUp]
    assert router.vehicle_link(1, 10.0).peer == THERE
