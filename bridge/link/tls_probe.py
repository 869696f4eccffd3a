"""Diagnosis of a link that does not open: the endpoint itself is tried, once no robot was found there."""

from __future__ import annotations

import socket
import ssl

from stopgo.bridge.link.keys import HeldKeys
from stopgo.bridge.link.link import endpoints_in

PROBE_S = 2.0
ALERT_S = 0.5
"""Wait for a server to refuse a certificate."""


def why_no_link(endpoints: str, keys: HeldKeys | None) -> str:
    """Return the fault of the link to `tls/10.1.2.3:7447`, or to several; empty if none is found."""
    found = [(endpoint, _why(endpoint, keys)) for endpoint in endpoints_in(endpoints)]
    if len(found) == 1:
        return found[0][1]
    return ", ".join(f"{endpoint}: {why}" for endpoint, why in found if why)


def _why(endpoint: str, keys: HeldKeys | None) -> str:
    protocol, _, rest = endpoint.partition("/")
    host, _, port = rest.partition("?")[0].partition("#")[0].rpartition(":")
    if protocol not in ("tcp", "tls"):
        return ""
    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=PROBE_S) as line:
            if keys is None:
                return f"it speaks TLS: write tls/{host}:{port}, and --keys DIR" if _speaks_tls(line) else ""
            return _handshake(line, host.strip("[]"), keys)
    except ConnectionRefusedError:
        return "nothing listens there"
    except OSError as error:
        return f"it cannot be reached ({error.strerror or error})"


def _speaks_tls(line: socket.socket) -> bool:
    """True if the other end answers a TLS greeting with TLS."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    line.settimeout(ALERT_S)
    try:
        with context.wrap_socket(line):
            return True
    except ssl.SSLError as error:
        return "ALERT" in (error.reason or "")
    except OSError:
        return False


def _handshake(line: socket.socket, host: str, keys: HeldKeys) -> str:
    files = keys.files
    context = ssl.create_default_context(cafile=str(files.authority))
    context.load_cert_chain(str(files.certificate), str(files.key))
    try:
        with context.wrap_socket(line, server_hostname=host) as secured:
            secured.settimeout(ALERT_S)
            secured.recv(1)
    except TimeoutError:
        return ""
    except ssl.SSLCertVerificationError as error:
        return _refused_here(error, host)
    except ssl.SSLError as error:
        return f"the other end does not take these keys ({error.reason or error})"
    return ""


def _refused_here(error: ssl.SSLCertVerificationError, host: str) -> str:
    if "mismatch" in error.verify_message or "not valid for" in error.verify_message:
        return (
            f"its certificate is not for {host}: have it issued again with --address {host}"
            " (stopgo keys rotate)"
        )
    return f"its certificate is not of the authority of these keys ({error.verify_message})"
