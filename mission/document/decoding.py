"""Decoding of JSON and MessagePack into typed objects, safe in threads; every fault is one kind of error."""

from __future__ import annotations

import os
import threading
from typing import Any, TypeVar

import msgspec

K = TypeVar("K")

_PREPARING = threading.RLock()
_PREPARED: dict[Any, msgspec.json.Decoder[Any]] = {}
if hasattr(os, "register_at_fork"):  # else a fork while another thread prepares a kind leaves it locked
    os.register_at_fork(
        before=_PREPARING.acquire,
        after_in_parent=_PREPARING.release,
        after_in_child=_PREPARING.release,
    )


def decoder_of(kind: Any) -> msgspec.json.Decoder[Any]:
    """Return the decoder of JSON documents of this kind, a class or any other type.

    `msgspec` prepares the fields of a class when the class is first decoded. The process ends in a
    segmentation fault if two threads do that at once, so one thread at a time prepares kinds here.
    """
    decoder = _PREPARED.get(kind)
    if decoder is None:
        with _PREPARING:
            decoder = _PREPARED[kind] = msgspec.json.Decoder(kind)
    return decoder


def decoded(document: bytes | bytearray | str | msgspec.Raw, kind: type[K]) -> K:
    """Return the object in a JSON document.

    Raises
    ------
    msgspec.DecodeError
        Whatever is wrong with it; `ValidationError`, which is one, with the JSON path.
    """
    return _of_one_error(decoder_of(kind).decode, document)


def unpacked(data: bytes, kind: type[K]) -> K:
    """Return the object in MessagePack bytes; raises as `decoded` does."""
    decoder_of(kind)
    return _of_one_error(msgspec.msgpack.Decoder(kind).decode, data)


def converted(values: object, kind: type[K], *, from_attributes: bool = False) -> K:
    """Return the object that these values describe; raises `msgspec.ValidationError` if they do not."""
    decoder_of(kind)
    try:
        return msgspec.convert(values, kind, from_attributes=from_attributes)
    except UnicodeError as error:
        raise msgspec.ValidationError(str(error)) from None


def _of_one_error(decode: Any, document: Any) -> Any:
    """Decode; what is no UTF-8, brackets nested too deeply (also in ignored parts), and database values that
    are neither text nor bytes raise other errors by themselves."""
    try:
        return decode(document)
    except (UnicodeError, TypeError) as error:
        raise msgspec.DecodeError(str(error)) from None
    except RecursionError:
        raise msgspec.DecodeError("it is nested too deeply") from None
