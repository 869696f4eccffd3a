"""Variants of a stage: ours by name, those of installed packages by name, or `package.module:function`.

What others wrote may be missing, fail, or return what no plan can be made of. Each of these ends in one line
that names the stage, the variant and what is wrong with it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from traceback import walk_tb
from types import FrameType
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.errors import InputError, StopgoError

T = TypeVar("T")


@dataclass(frozen=True)
class Variant(Generic[T]):
    """What carries out a stage, and what it is called in messages."""

    said: str
    """What stands before every message about it, such as `selector = my_lab:solve`."""
    name: str
    what: T
    """A function, or whatever else the stage asks for."""
    ours: bool = True

    def called(self, *arguments: Any, **options: Any) -> Any:
        """What the function returns; if it is another's, what goes wrong in it is told in its name."""
        if not callable(self.what):
            raise self.wrong(f"is {_kind_of(self.what)}, not a function")
        with self.blamed():
            return self.what(*arguments, **options)

    def blamed(self) -> AbstractContextManager[None]:
        """Within it, whatever goes wrong in another's code is told in the variant's name."""
        return nullcontext() if self.ours else _blaming(self.said)

    def wrong(self, problem: str) -> InputError:
        """The error that says what is wrong with what it gave."""
        return InputError(f"{self.said}: {problem}")

    def noun(self, given: object, kind: type[Any]) -> Any:
        """What was given, if it is of this kind."""
        if not isinstance(given, kind):
            raise self.wrong(f"gave {_kind_of(given)}, not a {kind.__name__}")
        return given

    def several(self, given: object, names: str, *, least: int = 2, most: int = 2) -> tuple[Any, ...]:
        """What was given, if it is a tuple of `least` to `most` things."""
        if not isinstance(given, tuple) or not least <= len(given) <= most:
            size = f" of {len(given)}" if isinstance(given, tuple) else ""
            raise self.wrong(f"gave {_kind_of(given)}{size}, not ({names})")
        return given

    def array(self, given: object, name: str, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
        """Finite numbers of this shape; None stands for any length."""
        try:
            found = np.asarray(given, dtype=np.float64)
        except (TypeError, ValueError):
            raise self.wrong(f"{name} is {_kind_of(given)}, not numbers") from None
        if found.size == 0 and len(shape) > 1 and shape[0] is None:
            found = found.reshape(0, *(length or 0 for length in shape[1:]))
        if found.ndim != len(shape) or any(
            want not in (None, has) for want, has in zip(shape, found.shape, strict=True)
        ):
            raise self.wrong(f"{name} has the shape {_shape(found.shape)}, not {_shape(shape)}")
        if not np.isfinite(found).all():
            raise self.wrong(f"{name} has {int((~np.isfinite(found)).sum())} numbers that are not finite")
        return found

    def check_held(self, given: object, name: str, shape: tuple[int | None, ...]) -> None:
        """Refuse what a noun holds, if it is not an array of finite numbers of this shape."""
        if not isinstance(given, np.ndarray):
            raise self.wrong(f"{name} is {_kind_of(given)}, not an array")
        self.array(given, name, shape)

    def indices(self, given: object, name: str, *, length: int | None, below: int) -> NDArray[np.int64]:
        """Whole numbers from 0 and below a limit, in one row."""
        found = self.array(given, name, (length,))
        bad = (found != np.rint(found)) | (found < 0) | (found >= below)
        if bad.any():
            raise self.wrong(f"{name} holds {found[bad][0]:g}, not whole numbers from 0 to {below - 1}")
        return found.astype(np.int64)


def variant(stage: str, name: str, known: Mapping[str, T], *, said: str = "") -> Variant[T]:
    """The variant of a stage that has this name; `said` names it in messages.

    Entry points of installed packages in the group `stopgo.<stage>` are known by their names.

    Raises
    ------
    InputError
        Naming the stage, the variant, and which there are, or why it cannot be loaded.
    """
    said = said or f"{stage} = {name}"
    if name in known:
        return Variant(said, name, known[name])
    points = {point.name: point for point in entry_points(group=f"stopgo.{stage}")}
    if name not in points and ":" not in name:
        there = ", ".join([*known, *sorted(points)])
        raise InputError(f"{said}: no such {stage}; known: {there}, or module:function")
    return Variant(said, name, _loaded(said, name, points.get(name)), ours=False)


def installed(stage: str) -> tuple[str, ...]:
    """Names of the variants that installed packages bring for a stage."""
    return tuple(sorted({point.name for point in entry_points(group=f"stopgo.{stage}")}))


def _loaded(said: str, name: str, point: EntryPoint | None) -> Any:
    module, _, function = (point.value if point else name).partition(":")
    if not module or not function:
        raise InputError(f"{said}: write package.module:function")
    with _blaming(said), _working_folder_last():
        found: Any = import_module(module)
        for part in function.split("."):
            found = getattr(found, part)
    return found


@contextmanager
def _working_folder_last() -> Iterator[None]:
    """Modules in the working folder are found too, and shadow none."""
    here = os.getcwd()
    sys.path.append(here)
    try:
        yield
    finally:
        sys.path.remove(here)


@contextmanager
def _blaming(who: str) -> Iterator[None]:
    """One line that names `who`, for whatever goes wrong in the code of others."""
    try:
        yield
    except StopgoError:
        raise
    except Exception as error:  # the code of others may raise anything; here it becomes one line
        raise InputError(f"{who}: {_told(error)}") from error


def _told(error: Exception) -> str:
    """What went wrong, and where in the file that was called."""
    told = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    theirs = [
        (frame.f_code.co_filename, line) for frame, line in walk_tb(error.__traceback__) if _is_theirs(frame)
    ]
    if not theirs or isinstance(error, SyntaxError):  # which says itself where
        return told
    file, line = next(found for found in reversed(theirs) if found[0] == theirs[0][0])
    return f"{told} ({os.path.basename(file)}, line {line})"


def _is_theirs(frame: FrameType) -> bool:
    """Whether what runs in a frame is neither ours nor what loads modules."""
    package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
    return package not in (
        __name__.partition(".")[0],
        "importlib",
        "_frozen_importlib",
        "_frozen_importlib_external",
    )


def _kind_of(given: object) -> str:
    return "nothing" if given is None else f"a {type(given).__name__}"


def _shape(shape: tuple[int | None, ...]) -> str:
    lengths = ", ".join("n" if length is None else str(length) for length in shape)
    return f"({lengths},)" if len(shape) == 1 else f"({lengths})"
