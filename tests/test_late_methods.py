"""Dataclasses whose methods are compiled late are like all others."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

from stopgo.late_methods import NAME, compile_when_called


def classes() -> list[Any]:
    """Dataclasses of several kinds, made now."""

    @dataclasses.dataclass(frozen=True)
    class Stop:
        x: float
        name: str = "s01"
        seen: list[int] = dataclasses.field(default_factory=list, compare=False, repr=False)

    @dataclasses.dataclass(frozen=True)
    class Doorway(Stop):
        width: float = 0.9

    @dataclasses.dataclass(order=True, slots=True)
    class Leg:
        metres: float

    @dataclasses.dataclass(eq=False)
    class Cycle:
        own: Any = None

    return [Stop, Doorway, Leg, Cycle]


def refusal(do: Callable[[], object]) -> str:
    with pytest.raises((dataclasses.FrozenInstanceError, TypeError)) as told:
        do()
    return f"{told.type.__name__}: {told.value}"


def told(kinds: list[Any]) -> list[object]:
    """What the methods of such classes say."""
    stop_of, doorway_of, leg_of, cycle_of = kinds
    stop, doorway, leg, cycle = stop_of(1.5), doorway_of(1.5, width=0.8), leg_of(2.0), cycle_of()
    cycle.own = cycle
    leg.metres += 1.0
    return [
        *map(repr, (stop, doorway, leg, cycle)),
        (
            stop == stop_of(1.5, seen=[1]),
            stop == stop_of(2.0),
            stop == doorway,
            stop == 1.5,
            cycle == cycle_of(),
        ),
        (leg == leg_of(3.0), leg < leg_of(3.5)),
        (
            hash(stop) == hash((1.5, "s01")),
            hash(doorway) == hash((1.5, "s01", 0.8)),
        ),
        refusal(lambda: setattr(stop, "x", 2.0)),
        refusal(lambda: setattr(doorway, "height", 2.0)),
        refusal(lambda: delattr(doorway, "x")),
        refusal(lambda: hash(leg)),
        refusal(stop_of),
        dataclasses.replace(doorway, x=3.0) == doorway_of(3.0, width=0.8),
        dataclasses.asdict(doorway),
        copy.deepcopy(doorway) == doorway,
        str(inspect.signature(doorway_of)),
        [(kind.__eq__.__name__, kind.__repr__.__qualname__, kind.__init__.__qualname__) for kind in kinds],
    ]


def test_late_methods_do_what_those_of_python_do(monkeypatch: pytest.MonkeyPatch) -> None:
    before = told(classes())
    monkeypatch.setattr(dataclasses, NAME, getattr(dataclasses, NAME, None), raising=False)
    compile_when_called()
    late = classes()
    assert told(late) == before
    assert told(late) == before  # and again, now that they are compiled


@pytest.mark.skipif(
    not hasattr(dataclasses, NAME), reason="this Python compiles all methods of a class at once"
)
def test_only_what_is_called_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    real = getattr(dataclasses, NAME)
    monkeypatch.setattr(dataclasses, NAME, lambda name, *a, **k: made.append(name) or real(name, *a, **k))
    compile_when_called()
    compile_when_called()  # which changes no more

    @dataclasses.dataclass(frozen=True)
    class Stop:
        x: float

    assert made == []
    assert Stop(1.0) == Stop(1.0) != Stop(2.0)
    assert made == ["__init__", "__eq__"]
    assert Stop.__init__.__code__.co_varnames == ("self", "x")  # it is called directly from now on


def test_the_command_compiles_late_and_python_does_not() -> None:
    """Who imports stopgo keeps Python's own dataclasses."""
    look = f"import dataclasses; print(getattr(dataclasses, {NAME!r}, print).__module__)"
    run = "import sys; sys.argv = ['stopgo', '--version']; import stopgo\nstopgo.main()\n"
    for before, module in (("import stopgo.planner\n", "dataclasses"), (run, "stopgo.late_methods")):
        done = subprocess.run(
            [sys.executable, "-c", before + look], capture_output=True, text=True, check=True
        )
        assert done.stdout.split()[-1] in (module, "builtins")


def test_a_frozen_plan_survives_a_copy_through_pickle(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans pass between processes; a method is found by the class, not sent."""
    monkeypatch.setattr(dataclasses, NAME, getattr(dataclasses, NAME, None), raising=False)
    compile_when_called()
    kind = dataclasses.make_dataclass("Sent", [("x", float)], frozen=True)
    monkeypatch.setattr(sys.modules[__name__], "Sent", kind, raising=False)
    kind.__module__ = __name__
    assert pickle.loads(pickle.dumps(kind(1.0))) == kind(1.0)
