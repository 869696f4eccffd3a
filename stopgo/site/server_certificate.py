"""A certificate that the site makes for its own address, where none is given."""

from __future__ import annotations

import datetime
import ipaddress
import os
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

DAYS = 30
LEAST_LEFT = datetime.timedelta(days=2)


@dataclass(frozen=True)
class OwnCertificate:
    """Files of a certificate, and its SHA-256 fingerprint as browsers show it."""

    certificate: Path
    key: Path
    fingerprint: str


def own_certificate(folder: Path, address: str) -> OwnCertificate:
    """Return the certificate of an address in a folder of this user; a new one if it expires soon."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    certificate, key = folder / "certificate.pem", folder / "key.pem"
    found = _valid(certificate, key)
    if found is None:
        found = _made(certificate, key, address)
    digest = found.fingerprint(hashes.SHA256()).hex().upper()
    return OwnCertificate(certificate, key, ":".join(digest[k : k + 2] for k in range(0, len(digest), 2)))


def _valid(certificate: Path, key: Path) -> x509.Certificate | None:
    try:
        found = x509.load_pem_x509_certificate(certificate.read_bytes())
    except (OSError, ValueError):
        return None
    left = found.not_valid_after_utc - datetime.datetime.now(datetime.UTC)
    return found if key.is_file() and left > LEAST_LEFT else None


def _made(certificate: Path, key: Path, address: str) -> x509.Certificate:
    private = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"stopgo site {address}")])
    now = datetime.datetime.now(datetime.UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(private.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(minutes=5))
        .not_valid_after(now + datetime.timedelta(days=DAYS))
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(address))]), critical=False
        )
        .sign(private, hashes.SHA256())
    )
    encoding, plain = serialization.Encoding.PEM, serialization.NoEncryption()
    secret = private.private_bytes(encoding, serialization.PrivateFormat.PKCS8, plain)
    with os.fdopen(os.open(key, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as file:
        file.write(secret)
    certificate.write_bytes(made.public_bytes(encoding))
    return made
