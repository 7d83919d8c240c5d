"""How a vehicle is reached, as written in a configuration.

``udpin:HOST:PORT`` listens and answers where it is spoken to from; ``udpout:HOST:PORT`` and ``tcp:HOST:PORT`` speak
first; ``serial:DEVICE:BAUD`` is a telemetry radio or a cable. ``udpin://HOST:PORT``, as MAVSDK writes it, is the same.
"""

from dataclasses import dataclass
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import Literal, get_args

from hsop_gcs.errors import BadInput

Address = tuple[str, int]
"""Host and port; of a serial line, device and baud."""

Kind = Literal["udpin", "udpout", "tcp", "serial"]
_KINDS: dict[str, Kind] = {kind: kind for kind in get_args(Kind)}
_FORMS = "udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"
_ANY_HOST = frozenset({"0.0.0.0", "::"})
_LOCALHOST = {"localhost": "127.0.0.1"}
_SLOWEST_BAUD, _FASTEST_BAUD = 1200, 4_000_000


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One end of a link."""

    kind: Kind
    host: str
    """Of a serial line: the device."""
    port: int
    """Of a serial line: the baud rate."""

    @property
    def is_stream(self) -> bool:
        """Whether bytes come without the bounds of datagrams."""
        return self.kind in ("tcp", "serial")

    def __str__(self) -> str:
        return f"{self.kind}:{_address(self.host, self.port)}"

    def excludes(self, other: "Endpoint") -> bool:
        """Whether both cannot be open at a time: two names of one listening port, or one device at two baud rates."""
        if self == other or self.kind != other.kind:
            return False
        if self.kind == "serial":
            return self.host == other.host
        hosts = {_LOCALHOST.get(host, host) for host in (self.host.lower(), other.host.lower())}
        return self.kind == "udpin" and self.port == other.port != 0 and (len(hosts) == 1 or bool(hosts & _ANY_HOST))


@dataclass(frozen=True, slots=True, order=True)
class Peer:
    """Where bytes come from and go to: which of our endpoints, by its number, and the address behind it."""

    transport: int
    host: str
    port: int

    @property
    def address(self) -> str:
        """For a person."""
        return _address(self.host, self.port)


@dataclass(frozen=True, slots=True)
class Pin:
    """The only address under which a vehicle is believed; port None: from any port of it."""

    host: str
    port: int | None

    def admits(self, peer: Peer) -> bool:
        """Whether a peer speaks from there."""
        return self.host == _canonical(peer.host) and self.port in (None, peer.port)

    def __str__(self) -> str:
        return self.host if self.port is None else _address(self.host, self.port)


def parse_pin(text: str) -> Pin:
    """Read ``10.0.0.5``, ``10.0.0.5:14550``, ``fd00::5`` or ``[fd00::5]:14550``. Raises BadInput for anything else."""
    host, port = text, None
    if text.startswith("[") or text.count(":") == 1:
        host, _, number = text.rpartition(":")
        if not number.isascii() or not number.isdigit() or not 1 <= int(number) <= 65535:
            raise BadInput("address", f"{number!r} in {text!r} is not a port")
        host, port = host.removeprefix("[").removesuffix("]"), int(number)
    try:
        return Pin(_canonical(str(ip_address(host))), port)
    except ValueError:
        raise BadInput("address", f"{text!r} is no IP address, with or without :PORT") from None


def _canonical(host: str) -> str:
    """An IPv4 address that comes over an IPv6 socket is written as what it is."""
    try:
        address: IPv4Address | IPv6Address = ip_address(host)
    except ValueError:
        return host
    mapped = address.ipv4_mapped if isinstance(address, IPv6Address) else None
    return str(mapped or address)


def _address(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host and "/" not in host else f"{host}:{port}"


def parse_endpoint(text: str) -> Endpoint:
    """Read an endpoint; port 0 of a udpin is any free one. Raises BadInput saying what is wrong with the text."""
    name, _, rest = text.partition(":")
    rest = rest.removeprefix("//") if name != "serial" else rest
    host, _, number = rest.rpartition(":")
    kind = _KINDS.get(name)
    if kind is None or not host or " " in text or not text.isprintable():
        raise BadInput("connection", f"{text!r} is none of {_FORMS}")
    if not number.isascii() or not number.isdigit():
        raise BadInput("connection", f"{number!r} in {text!r} is not a {'baud rate' if kind == 'serial' else 'port'}")
    if kind == "serial":
        if not _SLOWEST_BAUD <= int(number) <= _FASTEST_BAUD:
            raise BadInput("connection", f"baud rate {number} in {text!r} is not {_SLOWEST_BAUD} to {_FASTEST_BAUD}")
        return Endpoint(kind, host, int(number))
    bare = host.removeprefix("[").removesuffix("]") if host[0] == "[" and host[-1] == "]" else host
    if not bare or (":" in bare and bare == host):
        raise BadInput("connection", f"{host!r} in {text!r} is not a host (an IPv6 address needs brackets)")
    try:
        bare.encode("idna")
    except UnicodeError:
        raise BadInput("connection", f"{host!r} in {text!r} is not the name of a host") from None
    if not (0 if kind == "udpin" else 1) <= int(number) <= 65535:
        raise BadInput("connection", f"{number!r} in {text!r} is not a port")
    return Endpoint(kind, bare, int(number))
