"""A ground station on a virtual clock, face to face with one simulated vehicle."""

import math
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.link.codec import Decoder, Encoder, Frame
from hsop_gcs.link.enums import MavCmd, MavResult
from hsop_gcs.link.messages import CommandAck, CommandInt, CommandLong, Message, StatusText
from hsop_gcs.simulator.ardupilot import ArduCopter
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.px4 import Px4
from hsop_gcs.simulator.vehicle import Vehicle

Kind = TypeVar("Kind", bound=Message)

HOME = GeodeticPoint(lat_deg=-35.363261, lon_deg=149.165230, altitude_amsl_m=584.0)
CONFIG = VehicleConfig(system=1, home=HOME, wander_m=0.0)
OPERATOR, STRANGER = (255, 190), (245, 190)


class Station:
    """Sends messages as they come off the wire, hears everything, and lets time pass."""

    def __init__(self, vehicle: Vehicle, *, now: float = 0.0) -> None:
        self.vehicle = vehicle
        self.now = now
        self.heard: list[tuple[float, Message]] = []
        self._to_wire = Encoder(system=vehicle.config.system, component=1)
        self._from_wire = Decoder()

    def send(self, message: Message, sender: tuple[int, int] = OPERATOR) -> list[Message]:
        """Send one message over the wire's encoding; return what came back at once."""
        before = len(self.heard)
        raw = Encoder(system=sender[0], component=sender[1]).encode(message)
        for frame in Decoder().feed_datagram(raw):
            self.vehicle.receive(frame, self.now)
        self._hear()
        return [message for _, message in self.heard[before:]]

    def replay(self, frame: Frame, at: float) -> None:
        """Deliver a recorded frame at its time."""
        self.wait(at - self.now)
        self.vehicle.receive(frame, at)
        self._hear()

    def command_long(self, command: int, *, sender: tuple[int, int] = OPERATOR, **parameters: Any) -> MavResult | None:
        """Send a COMMAND_LONG; return its result, or None for silence."""
        empty = CommandLong(target_system=self.vehicle.config.system, target_component=1, command=command)
        return self._result(self.send(replace(empty, **parameters), sender), command)

    def command_int(self, command: int, *, sender: tuple[int, int] = OPERATOR, **fields: Any) -> MavResult | None:
        """Send a COMMAND_INT; return its result, or None for silence."""
        empty = CommandInt(target_system=self.vehicle.config.system, target_component=1, command=command)
        return self._result(self.send(replace(empty, **fields), sender), command)

    def wait(self, seconds: float) -> None:
        """Let time pass in small steps, so that what is heard carries its time."""
        end = self.now + seconds
        while self.now < end:
            self.now = min(end, self.now + 0.05)
            self.vehicle.advance(self.now)
            self._hear()

    def last(self, kind: type[Kind]) -> Kind:
        """Return the last message of a kind that was heard."""
        return next(message for _, message in reversed(self.heard) if isinstance(message, kind))

    def all(self, kind: type[Kind]) -> list[Kind]:
        return [message for _, message in self.heard if isinstance(message, kind)]

    @property
    def texts(self) -> list[str]:
        return [text.text for text in self.all(StatusText)]

    def reposition(self, east_m: float, north_m: float, up_m: float, **fields: Any) -> MavResult | None:
        """Order DO_REPOSITION as COMMAND_INT to a place given in local ENU, AMSL, with the change-mode flag."""
        place = self.vehicle.local.to_geodetic(np.array([east_m, north_m, up_m]))
        order: dict[str, Any] = {
            "frame": 0,
            "param1": -1.0,
            "param2": 1.0,
            "param4": math.nan,
            "x": round(place.lat_deg * 1e7),
            "y": round(place.lon_deg * 1e7),
            "z": place.altitude_amsl_m,
        }
        return self.command_int(MavCmd.DO_REPOSITION, **(order | fields))

    def _hear(self) -> None:
        for message in self.vehicle.take_outgoing():
            (frame,) = self._from_wire.feed_datagram(self._to_wire.encode(message))
            self.heard.append((self.now, frame.message))

    def _result(self, answers: list[Message], command: int) -> MavResult | None:
        acks = [answer for answer in answers if isinstance(answer, CommandAck) and answer.command == command]
        return MavResult(acks[-1].result) if acks else None


def px4(config: VehicleConfig = CONFIG) -> Station:
    return Station(Px4(config, now=0.0, rng=np.random.default_rng(7)))


def ardupilot(config: VehicleConfig = CONFIG) -> Station:
    return Station(ArduCopter(config, now=0.0, rng=np.random.default_rng(7)))
