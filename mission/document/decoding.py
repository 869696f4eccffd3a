"""Decoding of third-party JSON: every fault raises one kind of error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import msgspec


@contextmanager
def one_decode_error() -> Iterator[None]:
    """Turn every decoding fault into `msgspec.DecodeError` (of which `ValidationError` is one).

    Bytes that are no text, brackets nested too deeply (also in ignored parts), and database values that are
    neither text nor bytes raise other errors by themselves.
    """
    try:
        yield
    except (UnicodeDecodeError, TypeError) as error:
        raise msgspec.DecodeError(str(error)) from None
    except RecursionError:
        raise msgspec.DecodeError("it is nested too deeply") from None
