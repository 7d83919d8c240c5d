"""Bytes to messages and back, whatever the bytes."""

import math
from collections.abc import Sequence
from dataclasses import astuple, fields

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from hsop_gcs.link import messages
from hsop_gcs.link.codec import Decoder, Encoder
from hsop_gcs.link.messages import GlobalPositionInt, Heartbeat, Message, StatusText
from tests.link.strategies import SPOKEN, spoken

LONGEST_FRAME_BYTES = 10 + 255 + 2 + 13
QUICK = settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def same(one: Message, other: Message) -> bool:
    """Equal, where not-a-number equals itself."""

    def flat(value: object) -> list[object]:
        if isinstance(value, tuple):
            return [item for part in value for item in flat(part)]
        return ["nan"] if isinstance(value, float) and math.isnan(value) else [value]

    return type(one) is type(other) and flat(astuple(one)) == flat(astuple(other))


def fed_in_pieces(decoder: Decoder, stream: bytes, cuts: Sequence[int]) -> list[bytes]:
    """The frames a decoder finds in a stream that comes in pieces, cut at these places."""
    pieces = [stream[start:stop] for start, stop in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    return [frame.raw for piece in pieces for frame in decoder.feed_stream(piece)]


@pytest.mark.parametrize("cls", SPOKEN, ids=lambda cls: cls.NAME)
def test_every_message_has_the_fields_of_its_definition(cls: type[Message]) -> None:
    wire = dialect.mavlink_map[cls.ID]
    assert wire.msgname == cls.NAME
    assert sorted(wire.fieldnames) == sorted(field.name for field in fields(cls))


@QUICK
@given(spoken())
def test_every_message_comes_back_as_it_was_sent(message: Message) -> None:
    raw = Encoder(system=7, component=3).encode(message)
    (frame,) = Decoder().feed_datagram(raw)
    assert same(frame.message, message)
    assert (frame.system, frame.component, frame.raw) == (7, 3, raw)


def test_a_frame_carries_the_count_of_those_before_it() -> None:
    encoder = Encoder(system=1, component=1)
    frames = [frame for _ in range(300) for frame in Decoder().feed_datagram(encoder.encode(Heartbeat()))]
    assert [frame.sequence for frame in frames] == [number % 256 for number in range(300)]


@pytest.mark.parametrize(
    ("message", "named"),
    [
        (StatusText(text="x" * 51), "text"),
        (Heartbeat(type=256), "HEARTBEAT"),
        (GlobalPositionInt(lat=2**31), "GLOBAL_POSITION_INT"),
        (messages.HomePosition(q=(1.0, 0.0, 0.0)), "HOME_POSITION.q"),
    ],
)
def test_what_does_not_fit_the_wire_is_refused_by_name(message: Message, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        Encoder(system=1, component=1).encode(message)


@QUICK
@given(st.lists(st.binary(max_size=400), max_size=8))
def test_no_bytes_make_the_decoder_fail(pieces: list[bytes]) -> None:
    decoder = Decoder()
    for piece in pieces:
        decoder.feed_datagram(piece)
        decoder.feed_stream(piece)
        assert decoder.pending_bytes < LONGEST_FRAME_BYTES


NOISE = st.one_of(
    st.binary(max_size=40),
    st.sampled_from(
        [b"\xfd", b"\xfe", b"\xfd\x00", b"\xfd\x20\x00\x00", b"\xfe\xff", b"\xfd\xff\x00\x00\x01\x01\x01\xee\xee\xee"]
    ),
)


@QUICK
@given(st.lists(st.tuples(NOISE, spoken()), min_size=1, max_size=6), NOISE)
def test_good_frames_between_noise_are_all_understood(parts: list[tuple[bytes, Message]], tail: bytes) -> None:
    encoder = Encoder(system=1, component=1)
    raws = [encoder.encode(message) for _, message in parts]
    datagram = b"".join(noise + raw for (noise, _), raw in zip(parts, raws, strict=True)) + tail
    found = [frame.raw for frame in Decoder().feed_datagram(datagram) if frame.verified]
    assert found == raws


@QUICK
@given(spoken(), st.data())
def test_a_frame_with_a_flipped_bit_is_not_believed(message: Message, data: st.DataObject) -> None:
    raw = bytearray(Encoder(system=1, component=1).encode(message))
    bit = data.draw(st.integers(0, 8 * len(raw) - 1))
    raw[bit // 8] ^= 1 << bit % 8
    decoder = Decoder()
    assert [frame for frame in decoder.feed_datagram(bytes(raw)) if frame.verified] == []
    assert decoder.counters.bad_frames + decoder.counters.unknown + decoder.counters.skipped_bytes > 0


@QUICK
@given(st.lists(spoken(), max_size=6), st.data())
def test_a_stream_may_be_cut_anywhere(sent: list[Message], data: st.DataObject) -> None:
    encoder = Encoder(system=1, component=1)
    raws = [encoder.encode(message) for message in sent]
    stream = b"".join(raws)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    decoder = Decoder()
    found = fed_in_pieces(decoder, stream, cuts)
    assert found == raws
    assert decoder.pending_bytes == 0


SIGNATURE = st.lists(st.sampled_from([0x00, 0x01, 0x2A, 0xFD, 0xFE]), min_size=13, max_size=13).map(bytes)


@settings(QUICK, derandomize=True)
@given(st.lists(st.tuples(spoken(), SIGNATURE), max_size=6), st.data())
def test_a_signature_may_hold_what_a_frame_begins_with(sent: list[tuple[Message, bytes]], data: st.DataObject) -> None:
    signatures = iter([signature for _, signature in sent])
    encoder = Encoder(system=1, component=1, sign=lambda frame: frame + next(signatures))
    raws = [encoder.encode(message) for message, _ in sent]
    stream = b"".join(raws)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    decoder = Decoder()
    found = fed_in_pieces(decoder, stream, cuts)
    decoder.forget_partial()
    assert found == raws
    assert (decoder.counters.bad_frames, decoder.counters.skipped_bytes) == (0, 0)


@pytest.mark.parametrize("left", range(13))
@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_a_signed_frame_that_is_cut_in_its_signature_does_not_swallow_the_next(left: int, chunk: int) -> None:
    signed = Encoder(system=1, component=1, sign=lambda frame: frame + bytes(13)).encode(StatusText(text="cut"))
    good = [Encoder(system=1, component=1).encode(message) for message in (Heartbeat(), GlobalPositionInt())]
    stream = signed[: len(signed) - 13 + left] + b"".join(good)
    found = fed_in_pieces(Decoder(), stream, range(chunk, len(stream), chunk))
    assert found[-2:] == good


@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_a_frame_whose_last_byte_is_missing_does_not_swallow_the_next_that_begins_with_it(chunk: int) -> None:
    encoder = Encoder(system=1, component=1)
    cut = next(raw for n in range(5000) if (raw := encoder.encode(StatusText(id=n)))[-1] == 0xFD)
    good = Encoder(system=1, component=1).encode(Heartbeat())
    stream = cut[:-1] + good
    found = fed_in_pieces(Decoder(), stream, range(chunk, len(stream), chunk))
    assert found[-1] == good


def test_a_frame_with_flags_nobody_may_ignore_is_dropped() -> None:
    raw = bytearray(Encoder(system=1, component=1).encode(Heartbeat()))
    raw[2] = 0x02
    decoder = Decoder()
    assert decoder.feed_datagram(bytes(raw)) == []
    assert decoder.counters.bad_frames == 1
