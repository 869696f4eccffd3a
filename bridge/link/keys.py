"""A site's keys: an authority of its own, and a certificate for every station, viewer and robot.

A certificate's common name is its role, which the robot's access control goes by; its organisation is the
name of the one who holds it, which the lease goes by. Keys are Ed25519 and serve both the links (mTLS) and
the signatures. There are no revocation lists: certificates are short-lived.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import msgspec

from mission.errors import InputError

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

HolderRole = Literal["station", "viewer", "robot"]
ROLES: Final[tuple[HolderRole, ...]] = ("station", "viewer", "robot")
AUTHORITY = "authority"
AUTHORITY_DAYS = 3650
DAYS = 90
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.@-]{0,63}")


@dataclass(frozen=True)
class KeyFiles:
    """One holder's folder: the authority's certificate, its own, and its private key."""

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


class Holder(msgspec.Struct, frozen=True, kw_only=True):
    """Who a certificate was issued to."""

    role: HolderRole
    name: str
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


class Certificates:
    """Tells who holds a certificate, if the authority of one's own keys has issued it and it is valid now."""

    def __init__(self, held: HeldKeys, now: Callable[[], datetime]) -> None:
        self._held = held
        self._now = now
        self._read = lru_cache(maxsize=64)(self._issued)

    def holder(self, der: bytes) -> tuple[Holder, Ed25519PublicKey]:
        """Who holds a certificate, and the public key that proves it.

        Raises
        ------
        Untrusted
            If it is not the authority's, is none of ours, or is not valid now.
        """
        holder, public = self._read(der)
        if not holder.not_before <= self._now() <= holder.not_after:
            raise Untrusted(f"the certificate of {holder.name} ends {holder.not_after:%Y-%m-%d %H:%M} UTC")
        return holder, public

    def _issued(self, der: bytes) -> tuple[Holder, Ed25519PublicKey]:
        from cryptography import x509
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

        try:
            certificate = x509.load_der_x509_certificate(der)
        except ValueError:
            raise Untrusted("it has no certificate that can be read") from None
        try:
            certificate.verify_directly_issued_by(self._held.authority)
            public, holder = certificate.public_key(), holder_of(certificate)
        except (InvalidSignature, ValueError, TypeError):
            raise Untrusted("the certificate is of another authority") from None
        except InputError as error:
            raise Untrusted(str(error)) from None
        if not isinstance(public, Ed25519PublicKey):
            raise Untrusted("the certificate's key is not Ed25519")
        return holder, public


def init_site(folder: Path, *, now: datetime) -> None:
    """Make a site's authority in `folder`.

    Raises
    ------
    InputError
        If there is one already: everything issued by it would be worth nothing.
    """
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    files = KeyFiles(folder / AUTHORITY)
    if files.key.exists():
        raise InputError(f"{folder}: has an authority already; issue from it, or choose another folder")
    key = Ed25519PrivateKey.generate()
    name = _name(AUTHORITY, folder.resolve().name)
    certificate = _certificate(name, name, key.public_key(), key, now=now, days=AUTHORITY_DAYS, role=None)
    _write(files, certificate, certificate, key)


def issue(folder: Path, role: HolderRole, name: str, *, now: datetime, days: int = DAYS) -> KeyFiles:
    """Issue keys for `name` from the authority in `folder`, into a folder of that name.

    Raises
    ------
    InputError
        If there is no authority, or the name cannot be used or is taken.
    """
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    if not _NAME.fullmatch(name) or name == AUTHORITY:
        raise InputError(f"name {name!r}: use letters, digits, '_', '.', '@' and '-', and not {AUTHORITY!r}")
    files = KeyFiles(folder / name)
    if files.key.exists():
        raise InputError(f"{files.folder}: exists; move it away to issue new keys for {name}")
    authority_files = KeyFiles(folder / AUTHORITY)
    authority, authority_key = _read_certificate(authority_files.certificate), _read_key(authority_files.key)
    key = Ed25519PrivateKey.generate()
    certificate = _certificate(
        _name(role, name), authority.subject, key.public_key(), authority_key, now=now, days=days, role=role
    )
    _write(files, authority, certificate, key)
    return files


def read_keys(folder: Path, *, now: datetime) -> HeldKeys:
    """The keys in one holder's folder.

    Raises
    ------
    InputError
        If one is missing, unreadable by its owner alone, expired, or does not belong to the others.
    """
    from cryptography.exceptions import InvalidSignature

    files = KeyFiles(folder)
    authority, certificate = _read_certificate(files.authority), _read_certificate(files.certificate)
    key = _read_key(files.key)
    if os.name == "posix" and files.key.stat().st_mode & 0o077:
        raise InputError(f"{files.key}: others may read it; chmod 600 {files.key}")
    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError):
        raise InputError(f"{files.certificate}: not issued by {files.authority}; issue it again") from None
    if certificate.public_key() != key.public_key():
        raise InputError(f"{files.key}: is not the key of {files.certificate}; issue it again")
    holder = holder_of(certificate)
    if not holder.not_before <= now <= holder.not_after:
        raise InputError(
            f"{files.certificate}: valid from {holder.not_before:%Y-%m-%d %H:%M} to"
            f" {holder.not_after:%Y-%m-%d %H:%M} UTC; issue new keys for {holder.name}"
        )
    return HeldKeys(files, holder, authority, certificate, key)


def holder_of(certificate: x509.Certificate) -> Holder:
    """Role, name and validity that a certificate tells; raises `InputError` if it is none of ours."""
    from cryptography.x509.oid import NameOID

    roles = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    names = certificate.subject.get_attributes_for_oid(NameOID.ORGANIZATION_NAME)
    if not roles or not names or roles[0].value not in (*ROLES, AUTHORITY):
        raise InputError("the certificate names no role; issue it with stopgo keys")
    return Holder(
        role=roles[0].value,  # type: ignore[arg-type]
        name=str(names[0].value),
        not_before=certificate.not_valid_before_utc,
        not_after=certificate.not_valid_after_utc,
    )


def holders(folder: Path) -> tuple[Holder, ...]:
    """Everybody that the site's authority has issued keys to, by name."""
    found = sorted(path.parent for path in folder.glob("*/cert.pem") if path.parent.name != AUTHORITY)
    if not KeyFiles(folder / AUTHORITY).certificate.exists():
        raise InputError(f"{folder}: no authority there; make one with stopgo keys init {folder}")
    return tuple(holder_of(_read_certificate(KeyFiles(path).certificate)) for path in found)


def _name(role: str, name: str) -> x509.Name:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    return x509.Name(
        [x509.NameAttribute(NameOID.COMMON_NAME, role), x509.NameAttribute(NameOID.ORGANIZATION_NAME, name)]
    )


def _certificate(
    subject: x509.Name,
    issuer: x509.Name,
    public: object,
    signer: Ed25519PrivateKey,
    *,
    now: datetime,
    days: int,
    role: HolderRole | None,
) -> x509.Certificate:
    """A certificate; without a role it is an authority's own."""
    from cryptography import x509
    from cryptography.x509.oid import ExtendedKeyUsageOID

    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(public)  # type: ignore[arg-type]
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(minutes=5))
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.BasicConstraints(ca=role is None, path_length=0 if role is None else None), True)
    )
    if role is not None:
        # Only a robot may answer as a server, so that no viewer can stand in for one.
        server = [ExtendedKeyUsageOID.SERVER_AUTH] if role == "robot" else []
        usage = x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH, *server])
        names = x509.SubjectAlternativeName([x509.DNSName("robot.stopgo")])
        builder = builder.add_extension(usage, False).add_extension(names, False)
    return builder.sign(signer, None)


def _write(
    files: KeyFiles, authority: x509.Certificate, certificate: x509.Certificate, key: Ed25519PrivateKey
) -> None:
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    try:
        files.folder.mkdir(parents=True, exist_ok=True)
        files.authority.write_bytes(authority.public_bytes(Encoding.PEM))
        files.certificate.write_bytes(certificate.public_bytes(Encoding.PEM))
        private = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
        with open(os.open(files.key, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(private)
    except OSError as error:
        raise InputError(f"{files.folder}: cannot be written ({error.strerror})") from None


def _read_certificate(path: Path) -> x509.Certificate:
    from cryptography import x509

    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); make keys with stopgo keys") from None
    except ValueError:
        raise InputError(f"{path}: not a certificate") from None


def _read_key(path: Path) -> Ed25519PrivateKey:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        key = load_pem_private_key(path.read_bytes(), password=None)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); make keys with stopgo keys") from None
    except (ValueError, TypeError):
        raise InputError(f"{path}: not a private key") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise InputError(f"{path}: not an Ed25519 key; issue it with stopgo keys")
    return key


def now_utc() -> datetime:
    return datetime.now(UTC)
