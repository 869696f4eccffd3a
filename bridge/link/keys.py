"""One holder's keys, and whom they let it believe: everybody whom the same authority has issued keys to.

A certificate names who holds it in its common name (`robot:r1`, `station:alice`), so that a router can tell
one from another, and carries the role apart, as its organisational unit. Keys are Ed25519 and serve both the
links (mTLS) and the seals. `stopgo.bridge.link.authority` issues them and calls them back.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import msgspec

from stopgo.mission.document.decoding import one_decode_error
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

HolderRole = Literal["station", "viewer", "robot", "router"]
ROLES: Final[tuple[HolderRole, ...]] = ("station", "viewer", "robot", "router")
REVOKED = b"stopgo/1 revoked\n"
"""Goes before the list that is signed."""


@dataclass(frozen=True)
class KeyFiles:
    """One holder's folder: the authority's certificate, its own, its private key, and who is revoked."""

    folder: Path

    @property
    def authority(self) -> Path:
        return self.folder / "ca.pem"

    @property
    def certificate(self) -> Path:
        return self.folder / "cert.pem"

    @property
    def key(self) -> Path:
        return self.folder / "key.pem"

    @property
    def revoked(self) -> Path:
        return self.folder / "revoked.json"


class Holder(msgspec.Struct, frozen=True, kw_only=True):
    """Who a certificate was issued to."""

    role: HolderRole
    name: str
    serial: str
    """Of the certificate, hexadecimal."""
    not_before: datetime
    not_after: datetime


@dataclass(frozen=True)
class HeldKeys:
    """Keys that have been read and found to fit together."""

    files: KeyFiles
    holder: Holder
    authority: x509.Certificate
    certificate: x509.Certificate
    key: Ed25519PrivateKey

    @cached_property
    def der(self) -> bytes:
        """The certificate, as it goes beside messages."""
        from cryptography.hazmat.primitives.serialization import Encoding

        return self.certificate.public_bytes(Encoding.DER)


class Untrusted(Exception):
    """A signature that does not hold; the message says why."""


class Revoked(msgspec.Struct, frozen=True, kw_only=True):
    """Certificates that count no more."""

    number: int
    """Grows with every list; an older one does not replace a newer."""
    serials: tuple[str, ...]


class SignedList(msgspec.Struct, frozen=True, kw_only=True):
    """How `Revoked` is written to a file: signed by the authority, over the list as it stands there."""

    revoked: msgspec.Raw
    signature: bytes


def read_revoked(path: Path, authority: x509.Certificate) -> Revoked:
    """The list of revoked certificates.

    Raises
    ------
    InputError
        If it is missing, or not signed by the authority.
    """
    return _revoked_in(_list_bytes(path), path, authority)


def _list_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); copy it from the site's folder of keys, or have the"
            " keys issued anew if they are older than it (stopgo keys rotate)"
        ) from None


def _revoked_in(data: bytes, path: Path, authority: x509.Certificate) -> Revoked:
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    public = authority.public_key()
    assert isinstance(public, Ed25519PublicKey)
    try:
        with one_decode_error():
            signed = msgspec.json.decode(data, type=SignedList)
            public.verify(signed.signature, REVOKED + bytes(signed.revoked))
            return msgspec.json.decode(signed.revoked, type=Revoked)
    except msgspec.DecodeError:
        raise InputError(f"{path}: not a list of revoked keys; copy it from the site's folder") from None
    except InvalidSignature:
        raise InputError(f"{path}: not signed by the authority of these keys; copy it again") from None


class Certificates:
    """Tells who holds a certificate, if the authority of one's own keys has issued it and it counts now.

    The list of those revoked is looked at each time, and read again when its file has changed. One that
    cannot be read, or is older, does not replace what is known; with `state`, a folder where the newest is
    kept, not after a restart either.
    """

    def __init__(self, held: HeldKeys, now: Callable[[], datetime], state: Path | None = None) -> None:
        self._held = held
        self._now = now
        self._kept = None if state is None else kept_list(state, held.authority)
        self._issued_to = lru_cache(maxsize=64)(self._issued)
        self._lock = threading.Lock()
        self._revoked = Revoked(number=0, serials=())
        if self._kept is not None and self._kept.exists():
            self._revoked = _read_kept(self._kept, held.authority)
        self._stamp: tuple[int, ...] = ()

    def holder(self, der: bytes) -> tuple[Holder, Ed25519PublicKey]:
        """Who holds a certificate, and the public key that proves it.

        Raises
        ------
        Untrusted
            If it is not the authority's, is none of ours, is revoked, or is not valid now.
        """
        holder, public = self._issued_to(der)
        if not holder.not_before <= self._now() <= holder.not_after:
            raise Untrusted(f"the certificate of {holder.name} ends {holder.not_after:%Y-%m-%d %H:%M} UTC")
        if holder.serial in self._revoked_now().serials:
            raise Untrusted(f"the certificate of {holder.name} is revoked")
        return holder, public

    def _revoked_now(self) -> Revoked:
        path = self._held.files.revoked
        try:
            stat = os.stat(path)
        except OSError:
            return self._revoked
        stamp = (stat.st_mtime_ns, stat.st_size, stat.st_ino)
        with self._lock:
            if stamp != self._stamp:
                self._stamp = stamp
                with suppress(InputError):
                    data = _list_bytes(path)
                    self._learn(data, _revoked_in(data, path, self._held.authority))
            return self._revoked

    def _learn(self, data: bytes, read: Revoked) -> None:
        if read.number <= self._revoked.number:
            return
        self._revoked = read
        if self._kept is not None:
            with suppress(OSError):  # a full disk: until the next start it counts all the same
                self._kept.parent.mkdir(parents=True, exist_ok=True)
                write_atomic(self._kept, data)

    def _issued(self, der: bytes) -> tuple[Holder, Ed25519PublicKey]:
        from cryptography import x509
        from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

        try:
            certificate = x509.load_der_x509_certificate(der)
        except (ValueError, x509.InvalidVersion):
            raise Untrusted("it has no certificate that can be read") from None
        try:
            certificate.verify_directly_issued_by(self._held.authority)
            public, holder = certificate.public_key(), holder_of(certificate)
        except (InvalidSignature, UnsupportedAlgorithm, ValueError, TypeError):
            raise Untrusted("the certificate is of another authority") from None
        except InputError as error:
            raise Untrusted(str(error)) from None
        if not isinstance(public, Ed25519PublicKey):
            raise Untrusted("the certificate's key is not Ed25519")
        return holder, public


def kept_list(state: Path, authority: x509.Certificate) -> Path:
    """Where the newest list of one authority is kept, beside what else outlives a restart."""
    from cryptography.hazmat.primitives.hashes import SHA256

    return state / f"revoked-{authority.fingerprint(SHA256()).hex()[:16]}.json"


def _read_kept(path: Path, authority: x509.Certificate) -> Revoked:
    try:
        return read_revoked(path, authority)
    except InputError:
        raise InputError(
            f"{path}: the newest list of revoked keys that was kept is damaged; copy the site's newest"
            " revoked.json into the folder of keys, and remove this one"
        ) from None


def read_keys(folder: Path, *, now: datetime, state: Path | None = None) -> HeldKeys:
    """The keys in one holder's folder; a newer list of those revoked that is kept in `state` counts as well.

    Raises
    ------
    InputError
        If one is missing, readable by others than its owner, expired, revoked, of an older kind, or does not
        belong to the others.
    """
    from cryptography.exceptions import InvalidSignature

    files = KeyFiles(folder)
    authority, certificate = read_certificate(files.authority), read_certificate(files.certificate)
    key = read_key(files.key)
    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError):
        raise InputError(f"{files.certificate}: not issued by {files.authority}; issue it again") from None
    if certificate.public_key() != key.public_key():
        raise InputError(f"{files.key}: is not the key of {files.certificate}; issue it again")
    try:
        holder = holder_of(certificate)
    except InputError as error:
        raise InputError(f"{files.certificate}: {error}") from None
    if not holder.not_before <= now <= holder.not_after:
        raise InputError(
            f"{files.certificate}: valid from {holder.not_before:%Y-%m-%d %H:%M} to"
            f" {holder.not_after:%Y-%m-%d %H:%M} UTC; issue new keys for {holder.name}"
        )
    lists = [read_revoked(files.revoked, authority)]
    if state is not None and kept_list(state, authority).exists():
        lists.append(_read_kept(kept_list(state, authority), authority))
    revoked = max(lists, key=lambda revoked: revoked.number)
    if holder.serial in revoked.serials:
        raise InputError(f"{files.certificate}: is revoked; issue new keys for {holder.name}")
    return HeldKeys(files, holder, authority, certificate, key)


def holder_of(certificate: x509.Certificate) -> Holder:
    """Role, name and validity that a certificate tells; raises `InputError` if it is none of ours."""
    common, unit = common_name(certificate), _unit(certificate)
    if common in ROLES:
        raise InputError(
            "names its role and not its holder, as those of older versions did; have it issued anew:"
            f" stopgo keys rotate {_organisation(certificate) or 'NAME'} --in SITE-KEYS"
        )
    role = next((role for role in ROLES if role == unit), None)
    if role is None or not common.startswith(f"{role}:"):
        raise InputError("the certificate names no role; issue it with stopgo keys")
    return Holder(
        role=role,
        name=common.removeprefix(f"{role}:"),
        serial=f"{certificate.serial_number:x}",
        not_before=certificate.not_valid_before_utc,
        not_after=certificate.not_valid_after_utc,
    )


def common_name(certificate: x509.Certificate) -> str:
    """Empty if it has none."""
    from cryptography.x509.oid import NameOID

    return _attribute(certificate, NameOID.COMMON_NAME)


def _unit(certificate: x509.Certificate) -> str:
    from cryptography.x509.oid import NameOID

    return _attribute(certificate, NameOID.ORGANIZATIONAL_UNIT_NAME)


def _organisation(certificate: x509.Certificate) -> str:
    from cryptography.x509.oid import NameOID

    return _attribute(certificate, NameOID.ORGANIZATION_NAME)


def _attribute(certificate: x509.Certificate, oid: x509.ObjectIdentifier) -> str:
    found = certificate.subject.get_attributes_for_oid(oid)
    return str(found[0].value) if found else ""


def read_certificate(path: Path) -> x509.Certificate:
    """The certificate in a file; raises `InputError` naming it."""
    from cryptography import x509

    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); make keys with stopgo keys") from None
    except (ValueError, x509.InvalidVersion):
        raise InputError(f"{path}: not a certificate") from None


def read_key(path: Path) -> Ed25519PrivateKey:
    """The private key in a file that its owner alone may read or write; raises `InputError` naming it."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        mode = path.stat().st_mode
        key = load_pem_private_key(path.read_bytes(), password=None)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); make keys with stopgo keys") from None
    except (ValueError, TypeError):
        raise InputError(f"{path}: not a private key") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise InputError(f"{path}: not an Ed25519 key; issue it with stopgo keys")
    if os.name == "posix" and mode & 0o077:
        raise InputError(f"{path}: others may read or write it; chmod 600 {path}")
    return key


def now_utc() -> datetime:
    return datetime.now(UTC)
