"""Variants of a stage: ours by name, those of installed packages by name, or `package.module:function`.

Third-party code may be missing, fail, or return an unusable result. Each fault becomes one line that names
the stage, the variant and the problem.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from importlib import import_module
from traceback import walk_tb
from types import FrameType
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.errors import InputError, StopgoError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")


@dataclass(frozen=True)
class Variant(Generic[T]):
    """Function of a stage, and its name in messages."""

    said: str
    """Beginning of every message about it, such as `selector = my_lab:solve`."""
    name: str
    what: T
    """A function, or another object that the stage requires."""
    ours: bool = True

    def called(self, *arguments: Any, **options: Any) -> Any:
        """Return the function's result; an error of a third-party function is raised in its name."""
        if not callable(self.what):
            raise self.wrong(f"is {_kind_of(self.what)}, not a function")
        with self.named_errors():
            return self.what(*arguments, **options)

    def named_errors(self) -> AbstractContextManager[None]:
        """Return a context that raises errors of third-party code in the variant's name."""
        return nullcontext() if self.ours else _errors_named(self.said)

    def wrong(self, problem: str) -> InputError:
        """Return the error with this problem of the variant."""
        return InputError(f"{self.said}: {problem}")

    def of_kind(self, given: object, kind: type[Any]) -> Any:
        """Return the given object, if it is of this kind."""
        if not isinstance(given, kind):
            raise self.wrong(f"gave {_kind_of(given)}, not a {kind.__name__}")
        return given

    def several(self, given: object, names: str, *, least: int = 2, most: int = 2) -> tuple[Any, ...]:
        """Return the given object, if it is a tuple of `least` to `most` items."""
        if not isinstance(given, tuple) or not least <= len(given) <= most:
            size = f" of {len(given)}" if isinstance(given, tuple) else ""
            raise self.wrong(f"gave {_kind_of(given)}{size}, not ({names})")
        return given

    def array(self, given: object, name: str, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
        """Return finite numbers of this shape; None means any length."""
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

    def check_array(self, given: object, name: str, shape: tuple[int | None, ...]) -> None:
        """Refuse a field of a stage result that is not an array of finite numbers of this shape."""
        if not isinstance(given, np.ndarray):
            raise self.wrong(f"{name} is {_kind_of(given)}, not an array")
        self.array(given, name, shape)

    def indices(self, given: object, name: str, *, length: int | None, below: int) -> NDArray[np.int64]:
        """Return whole numbers from 0 and below a limit, in one row."""
        found = self.array(given, name, (length,))
        bad = (found != np.rint(found)) | (found < 0) | (found >= below)
        if bad.any():
            raise self.wrong(f"{name} holds {found[bad][0]:g}, not whole numbers from 0 to {below - 1}")
        return found.astype(np.int64)


def variant(stage: str, name: str, known: Mapping[str, T], *, said: str = "") -> Variant[T]:
    """Return the variant of a stage that has this name; `said` names it in messages.

    Entry points of installed packages in the group `stopgo.<stage>` are known by their names.

    Raises
    ------
    InputError
        Naming the stage, the variant, and the known variants, or why it cannot be loaded.
    """
    said = said or f"--{stage} {name}"
    if name in known:
        return Variant(said, name, known[name])
    points = {point.name: point for point in _installed(stage)}
    if name not in points and ":" not in name:
        there = ", ".join([*known, *sorted(points)])
        raise InputError(f"{said}: no such {stage}; known: {there}, or module:function")
    return Variant(said, name, _loaded(said, name, points.get(name)), ours=False)


def loader(reference: str) -> Callable[[], Any]:
    """Return a function that loads one of our `module:function` when it is first needed."""
    module, _, function = reference.partition(":")
    return lambda: getattr(import_module(module), function)


def installed(stage: str) -> tuple[str, ...]:
    """Return the names of the variants that installed packages provide for a stage."""
    return tuple(sorted({point.name for point in _installed(stage)}))


def _installed(stage: str) -> Iterable[EntryPoint]:
    """The entry points of a stage's variants in all installed packages."""
    from importlib import metadata

    return metadata.entry_points(group=f"stopgo.{stage}")


def _loaded(said: str, name: str, point: EntryPoint | None) -> Any:
    module, _, function = (point.value if point else name).partition(":")
    if not module or not function:
        raise InputError(f"{said}: write package.module:function")
    with _errors_named(said), _working_folder_last():
        found: Any = import_module(module)
        for part in function.split("."):
            found = getattr(found, part)
    return found


@contextmanager
def _working_folder_last() -> Iterator[None]:
    """Search modules in the working folder last, so that they hide no others."""
    here = os.getcwd()
    sys.path.append(here)
    try:
        yield
    finally:
        sys.path.remove(here)


@contextmanager
def _errors_named(who: str) -> Iterator[None]:
    """Turn every error of third-party code into one line that names `who`."""
    try:
        yield
    except StopgoError:
        raise
    except Exception as error:  # the code of others may raise anything; here it becomes one line
        raise InputError(f"{who}: {_error_text(error)}") from error


def _error_text(error: Exception) -> str:
    """Return the error in words, with the line in the file that was called."""
    text = _moved(error) or (f"{type(error).__name__}: {error}" if str(error) else type(error).__name__)
    frames = [
        (frame.f_code.co_filename, line)
        for frame, line in walk_tb(error.__traceback__)
        if _is_third_party(frame)
    ]
    if not frames or isinstance(error, SyntaxError):  # which contains its line
        return text
    file, line = next(found for found in reversed(frames) if found[0] == frames[0][0])
    return f"{text} ({os.path.basename(file)}, line {line})"


FORMER_FOLDERS = ("mission", "planner", "bridge", "recordings")
"""Packages of 0.1 at the top level; since 0.2 they are below `stopgo`."""


def _moved(error: Exception) -> str:
    """Return the line for an import path of 0.1, with today's path; empty for another error."""
    name = (error.name or "").partition(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    if name not in FORMER_FOLDERS:
        return ""
    events = "; mission.events is stopgo.mission.run.events" if name == "mission" else ""
    return f"imports {name}, a package of stopgo 0.1; import stopgo.{name} instead{events}"


def _is_third_party(frame: FrameType) -> bool:
    """True if a frame runs third-party code, and not the module loader."""
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
