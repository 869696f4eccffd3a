"""Keys of one holder, and the check of other holders' certificates: all have the same authority.

A certificate names who holds it in its common name (`robot:r1`, `station:alice`), so that a router can
distinguish them, and carries the role apart, as its organisational unit. Keys are Ed25519, for the
links (mTLS) and for the signatures of messages. `stopgo.bridge.link.authority` issues and revokes them.
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

from stopgo.mission.console.whole_file import whole_file
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

HolderRole = Literal["station", "viewer", "robot", "router"]
ROLES: Final[tuple[HolderRole, ...]] = ("station", "viewer", "robot", "router")
REVOKED = b"stopgo/1 revoked\n"
"""Prefix of the signed list."""


@dataclass(frozen=True)
class KeyFiles:
    """One holder's folder: the authority's certificate, its own, its private key, and the revoked list."""

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
    """The holder that a certificate was issued to."""

    role: HolderRole
    name: str
    serial: str
    """Serial number of the certificate, hexadecimal."""
    not_before: datetime
    not_after: datetime


@dataclass(frozen=True)
class HeldKeys:
    """Keys that were read and belong together."""

    files: KeyFiles
    holder: Holder
    authority: x509.Certificate
    certificate: x509.Certificate
    key: Ed25519PrivateKey

    @cached_property
    def der(self) -> bytes:
        """The certificate, as messages carry it."""
        from cryptography.hazmat.primitives.serialization import Encoding

        return self.certificate.public_bytes(Encoding.DER)


class Untrusted(Exception):
    """A signature or a sender that is not valid; the message has the reason."""


class Revoked(msgspec.Struct, frozen=True, kw_only=True):
    """List of the certificates that are no longer valid."""

    number: int
    """Number of the list; a list never replaces one with a higher number."""
    serials: tuple[str, ...]


class SignedList(msgspec.Struct, frozen=True, kw_only=True):
    """A `Revoked` list as a file: the list's bytes, with the authority's signature over them."""

    revoked: msgspec.Raw
    signature: bytes


def read_revoked(path: Path, authority: x509.Certificate) -> Revoked:
    """Return the list of revoked certificates.

    Raises
    ------
    InputError
        If it is missing, or not signed by the authority.
    """
    return _revoked_in(_list_bytes(path), path, authority)


def _list_bytes(path: Path) -> bytes:
    try:
        return whole_file(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); copy it from the site's folder of keys, or have the"
            " keys issued again if they are older than it (stopgo keys rotate)"
        ) from None


def _revoked_in(data: bytes, path: Path, authority: x509.Certificate) -> Revoked:
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    public = authority.public_key()
    assert isinstance(public, Ed25519PublicKey)
    try:
        signed = decoded(data, SignedList)
        public.verify(signed.signature, REVOKED + bytes(signed.revoked))
        return decoded(signed.revoked, Revoked)
    except msgspec.DecodeError:
        raise InputError(f"{path}: not a list of revoked keys; copy it from the site's folder") from None
    except InvalidSignature:
        raise InputError(f"{path}: not signed by the authority of these keys; copy it again") from None


class Certificates:
    """Finds the holder of a certificate, if the authority of one's own keys issued it and it is valid.

    The revoked list is read again when its file has changed. A list that cannot be read, or is older, does
    not replace the known one; with the folder `state`, not even after a restart.
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
        """Return the holder of a certificate, and its public key.

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
    """Return the path of an authority's newest list in the state folder."""
    from cryptography.hazmat.primitives.hashes import SHA256

    return state / f"revoked-{authority.fingerprint(SHA256()).hex()[:16]}.json"


def _read_kept(path: Path, authority: x509.Certificate) -> Revoked:
    try:
        return read_revoked(path, authority)
    except InputError:
        raise InputError(
            f"{path}: the stored list of revoked keys is damaged; copy the site's newest"
            " revoked.json into the folder of keys, and remove this one"
        ) from None


def read_keys(folder: Path, *, now: datetime, state: Path | None = None) -> HeldKeys:
    """Read the keys in one holder's folder; a newer revoked list in the folder `state` counts too.

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
    """Return role, name and validity from a certificate; raises `InputError` if stopgo did not issue it."""
    common, unit = common_name(certificate), _unit(certificate)
    if common in ROLES:
        raise InputError(
            "names its role and not its holder, as those of older versions did; have it issued again:"
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
    """Return the common name; empty if there is none."""
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
    """Read the certificate in a file; raises `InputError` naming it."""
    from cryptography import x509

    try:
        return x509.load_pem_x509_certificate(whole_file(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); make keys with stopgo keys") from None
    except (ValueError, x509.InvalidVersion):
        raise InputError(f"{path}: not a certificate") from None


def read_key(path: Path) -> Ed25519PrivateKey:
    """Read a private key; raises `InputError` if others than its owner may read or write the file."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        mode = path.stat().st_mode
        key = load_pem_private_key(whole_file(path), password=None)
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
