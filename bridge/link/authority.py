"""A site's certificate authority, in the office: it issues keys, renews and revokes them.

A site's folder holds `authority/` (its key, every certificate it has issued, and the list of those revoked)
and a folder for each holder, to be given to that machine.
"""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Iterable, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import msgspec

from stopgo.bridge.link.keys import (
    REVOKED,
    ROLES,
    Holder,
    HolderRole,
    KeyFiles,
    Revoked,
    SignedList,
    common_name,
    holder_of,
    read_certificate,
    read_key,
    read_revoked,
)
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import replacing, write_atomic

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

AUTHORITY: Final = "authority"
AUTHORITY_DAYS: Final = 3650
DAYS: Final = 90
ADDRESSES: Final = ("127.0.0.1", "::1", "localhost")
"""Addresses at which every robot and router may be reached."""
SERVERS: Final[tuple[HolderRole, ...]] = ("robot", "router")
"""Roles that others connect to."""
NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.@-]{0,55}")
"""At most 56 characters: with its role it is a common name, which takes 64."""

KeyState = Literal["valid", "expired", "revoked"]


class Issued(msgspec.Struct, frozen=True, kw_only=True):
    """A certificate that the authority has issued."""

    holder: Holder
    state: KeyState
    current: bool
    """True if it is the one in its holder's folder, which replaced the others."""


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
    name = _subject(AUTHORITY, folder.resolve().name)
    certificate = _certificate(name, name, key.public_key(), key, now=now, days=AUTHORITY_DAYS, role=None)
    _make_folder(files.folder / "issued")
    _write(files, certificate, certificate, key, _signed(Revoked(number=0, serials=()), key))


def issue(
    folder: Path,
    role: HolderRole,
    name: str,
    *,
    now: datetime,
    days: int = DAYS,
    addresses: Sequence[str] = (),
) -> KeyFiles:
    """Issue keys for `name` from the authority in `folder`, into a folder of that name.

    `addresses` are those that a robot or router is reached at, besides this machine's own.

    Raises
    ------
    InputError
        If there is no authority, or the name cannot be used or is taken.
    """
    if not NAME.fullmatch(name) or name == AUTHORITY:
        raise InputError(
            f"name {name!r}: use letters, digits, '_', '.', '@' and '-' (at most 56), and not {AUTHORITY!r}"
        )
    if addresses and role not in SERVERS:
        raise InputError(f"--address has no meaning for a {role}: nobody connects to it; leave it out")
    files = KeyFiles(folder / name)
    if files.key.exists():
        raise InputError(f"{files.folder}: exists; renew them with stopgo keys rotate {name} --in {folder}")
    _issue(folder, role, name, now=now, days=days, addresses=addresses)
    return files


def rotate(
    folder: Path, name: str, *, now: datetime, days: int = DAYS, addresses: Sequence[str] = ()
) -> KeyFiles:
    """Issue new keys to one who has some; the old ones count until they end or are revoked.

    Without `addresses` those of the old certificate are kept.

    Raises
    ------
    InputError
        If nobody of that name holds keys here.
    """
    files = _folder_of(folder, name)
    before = read_certificate(files.certificate)
    common = common_name(before)
    role = next((role for role in ROLES if common == role or common.startswith(f"{role}:")), None)
    if role is None:
        raise InputError(f"{files.certificate}: names no role; issue keys with stopgo keys issue")
    kept = addresses or (_addresses(before) if role in SERVERS else ())
    _issue(folder, role, name, now=now, days=days, addresses=kept)
    return files


def revoke(folder: Path, name: str, *, old: bool = False) -> tuple[str, ...]:
    """Revoke the certificates of `name`: all, or only the replaced (`old`) ones; return their serials.

    The list goes into every holder's folder here; it counts on a machine from when it is copied there.

    Raises
    ------
    InputError
        If nothing was ever issued to that name.
    """
    files = _folder_of(folder, name)
    current = f"{read_certificate(files.certificate).serial_number:x}"
    serials = {f"{one.serial_number:x}" for one in _all_issued(folder) if _is_of(one, name)} | {current}
    if old:
        serials.discard(current)
    before = _revoked(folder)
    fresh = tuple(sorted(serials - set(before.serials)))
    if fresh:
        key = read_key(KeyFiles(folder / AUTHORITY).key)
        after = Revoked(number=before.number + 1, serials=tuple(sorted({*before.serials, *serials})))
        _distribute(folder, _signed(after, key))
    return fresh


def listed(folder: Path, *, now: datetime) -> tuple[Issued, ...]:
    """Return every certificate that the site's authority has issued, by name, the newest first."""
    revoked, found = _revoked(folder).serials, []
    for certificate in _all_issued(folder):
        holder = holder_of(certificate)
        path = KeyFiles(folder / holder.name).certificate
        state: KeyState = "valid" if holder.not_before <= now <= holder.not_after else "expired"
        found.append(
            Issued(
                holder=holder,
                state="revoked" if holder.serial in revoked else state,
                current=path.exists() and read_certificate(path) == certificate,
            )
        )
    newest_first = sorted(found, key=lambda one: one.holder.not_before, reverse=True)
    return tuple(sorted(newest_first, key=lambda one: (one.holder.name, not one.current)))


def _folder_of(folder: Path, name: str) -> KeyFiles:
    if not KeyFiles(folder / AUTHORITY).certificate.exists():
        raise InputError(f"{folder}: no authority there; make one with stopgo keys init {folder}")
    files = KeyFiles(folder / name)
    if not NAME.fullmatch(name) or name == AUTHORITY or not files.certificate.exists():
        raise InputError(f"{name!r}: holds no keys in {folder}; stopgo keys list {folder} shows who does")
    return files


def _is_of(certificate: x509.Certificate, name: str) -> bool:
    return common_name(certificate).partition(":")[2] == name


def _all_issued(folder: Path) -> list[x509.Certificate]:
    authority = KeyFiles(folder / AUTHORITY)
    if not authority.certificate.exists():
        raise InputError(f"{folder}: no authority there; make one with stopgo keys init {folder}")
    return [read_certificate(path) for path in sorted((authority.folder / "issued").glob("*.pem"))]


def _revoked(folder: Path) -> Revoked:
    """Return the site's list; a site from before there were lists has an empty one."""
    files = KeyFiles(folder / AUTHORITY)
    if not files.revoked.exists():
        return Revoked(number=0, serials=())
    return read_revoked(files.revoked, read_certificate(files.certificate))


def _distribute(folder: Path, revoked: bytes) -> None:
    """Write the list into the folders of all holders, and into the authority's last."""
    holders = sorted(path.parent for path in folder.glob("*/cert.pem") if path.parent.name != AUTHORITY)
    for path in (*holders, folder / AUTHORITY):
        write_atomic(KeyFiles(path).revoked, revoked)


def _issue(
    folder: Path, role: HolderRole, name: str, *, now: datetime, days: int, addresses: Sequence[str]
) -> None:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import Encoding

    authority_files = KeyFiles(folder / AUTHORITY)
    authority, authority_key = read_certificate(authority_files.certificate), read_key(authority_files.key)
    key = Ed25519PrivateKey.generate()
    certificate = _certificate(
        _subject(f"{role}:{name}", None, role), authority.subject, key.public_key(), authority_key, now=now,
        days=days, role=role, addresses=addresses,
    )  # fmt: skip
    _make_folder(authority_files.folder / "issued")
    issued = authority_files.folder / "issued" / f"{certificate.serial_number:x}.pem"
    write_atomic(issued, certificate.public_bytes(Encoding.PEM))
    files = KeyFiles(folder / name)
    _make_folder(files.folder)
    _write(files, authority, certificate, key, _signed(_revoked(folder), authority_key))


def _signed(revoked: Revoked, key: Ed25519PrivateKey) -> bytes:
    encoded = msgspec.json.encode(revoked)
    signature = key.sign(REVOKED + encoded)
    return msgspec.json.encode(SignedList(revoked=msgspec.Raw(encoded), signature=signature))


def _subject(common: str, organisation: str | None, unit: str | None = None) -> x509.Name:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    parts = (
        (NameOID.COMMON_NAME, common),
        (NameOID.ORGANIZATION_NAME, organisation),
        (NameOID.ORGANIZATIONAL_UNIT_NAME, unit),
    )
    return x509.Name([x509.NameAttribute(oid, value) for oid, value in parts if value])


def _certificate(
    subject: x509.Name,
    issuer: x509.Name,
    public: object,
    signer: Ed25519PrivateKey,
    *,
    now: datetime,
    days: int,
    role: HolderRole | None,
    addresses: Iterable[str] = (),
) -> x509.Certificate:
    """Return a certificate; without a role it is an authority's own."""
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
        # Only robots and routers may answer as servers, and only at their own addresses.
        server = [ExtendedKeyUsageOID.SERVER_AUTH] if role in SERVERS else []
        usage = x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH, *server])
        every = dict.fromkeys((*ADDRESSES, *addresses)) if server else ("holder.stopgo",)
        names = x509.SubjectAlternativeName([_general_name(address) for address in every])
        builder = builder.add_extension(usage, False).add_extension(names, False)
    return builder.sign(signer, None)


def _general_name(address: str) -> x509.GeneralName:
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(address))
    except ValueError:
        pass
    if not re.fullmatch(r"(?=.{1,253}$)[A-Za-z0-9]([A-Za-z0-9-]{0,62}\.?)*", address):
        raise InputError(f"--address {address}: neither an IP address nor the name of a machine")
    return x509.DNSName(address)


def _addresses(certificate: x509.Certificate) -> tuple[str, ...]:
    """Return the addresses of the holder, as issued."""
    from cryptography import x509

    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    values = (str(name.value) for name in names)
    return tuple(address for address in values if not address.endswith(".stopgo"))


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None


def _write(
    files: KeyFiles,
    authority: x509.Certificate,
    certificate: x509.Certificate,
    key: Ed25519PrivateKey,
    revoked: bytes,
) -> None:
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    private = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    with replacing(files.authority, files.revoked, files.key, files.certificate) as temporaries:
        os.chmod(temporaries[2], 0o600)
        contents = (
            authority.public_bytes(Encoding.PEM),
            revoked,
            private,
            certificate.public_bytes(Encoding.PEM),
        )
        for path, content in zip(temporaries, contents, strict=True):
            path.write_bytes(content)
