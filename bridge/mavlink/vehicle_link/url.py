"""URL of a MAVLink peer: udpin:H:P, udpout:H:P, tcp:H:P, tcpin:H:P, serial:PATH:BAUD, `//` optional."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stopgo.mission.errors import InputError

UrlKind = Literal["udpin", "udpout", "tcp", "tcpin", "serial"]
KINDS: tuple[UrlKind, ...] = ("udpin", "udpout", "tcp", "tcpin", "serial")
HOW = (
    "write it udpin:HOST:PORT (listen), udpout:HOST:PORT (send there), tcp:HOST:PORT (connect),"
    " tcpin:HOST:PORT (listen) or serial:PATH:BAUD, such as udpout:127.0.0.1:14550"
)
BAUDS = range(1200, 4_000_001)


@dataclass(frozen=True)
class Url:
    kind: UrlKind
    host: str
    """Address, or the serial device's path."""
    number: int
    """Port, or baud."""

    def __str__(self) -> str:
        v6 = self.kind != "serial" and ":" in self.host
        return f"{self.kind}:{f'[{self.host}]' if v6 else self.host}:{self.number}"

    @property
    def stays_here(self) -> bool:
        """True if nothing leaves this machine over a network."""
        from stopgo.bridge.link.zenoh_link import is_loopback

        return self.kind == "serial" or is_loopback(self.host)


def read_url(text: str, option: str = "--mavlink") -> Url:
    """The URL in `text`, given for `option`.

    Raises
    ------
    InputError
        If it is not a URL.
    """
    kind, _, rest = text.partition(":")
    host, _, number = rest.removeprefix("//").rpartition(":")
    known = next((known for known in KINDS if known == kind), None)
    if known is None or not host or not (number.isascii() and number.isdecimal()):
        raise InputError(f"{option} {text}: not a MAVLink URL; {HOW}")
    allowed = BAUDS if known == "serial" else range(1, 65536)
    if int(number) not in allowed:
        what = "baud rate" if known == "serial" else "port"
        raise InputError(f"{option} {text}: {number} is no {what} ({allowed[0]} to {allowed[-1]})")
    return Url(known, host.strip("[]"), int(number))


def check_guarded(url: Url, *, signed: bool, insecure: bool, option: str = "--mavlink") -> None:
    """Refuse to send unsigned messages from this machine, unless `insecure` allows it.

    Raises
    ------
    InputError
        With the remedies.
    """
    if not (url.stays_here or signed or insecure):
        raise InputError(
            f"{option} {url}: leaves this machine unsigned; use 127.0.0.1, sign with --signing-key FILE,"
            " or add --insecure"
        )
