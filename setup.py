"""Where the folders of the tree go when stopgo is installed, and the kernels that are compiled then.

The folders go below `stopgo`, the one name that it takes. The links `stopgo/mission -> ../mission` and so
on say the same to type checkers and editors. The build does not follow them, so that it also works where
a checkout has no links, as on Windows.

Each kernel is one Python file. Cython and a C compiler make a second module of it, `<name>_compiled`, with
the types of `<name>_compiled.pxd`. Without either the kernels stay interpreted, with the same results. The
environment variable STOPGO_PURE leaves them out, for a wheel that fits every machine, as robots need it.
"""

import os
import sys
from pathlib import Path
from typing import Any

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext

FOLDERS = ("mission", "planner", "bridge", "recordings")
TYPES = sorted(Path("planner").rglob("*_compiled.pxd"))
ARRAYS = "stopgo.planner.geometry.arrays_compiled"
"""Cython's own code that takes arrays: one module for all kernels, each would compile it anew for 5 s."""
RULES = {
    "language_level": 3,
    "annotation_typing": False,  # `int` there is a Python number; the types are in the .pxd
    "boundscheck": False,
    "wraparound": False,
    "cdivision": False,  # // and % round as in Python
}

# The same sums on every processor; and no debugger's table, which would make 1 MB of 0.2.
FLAGS = [] if sys.platform == "win32" else ["-g0", "-ffp-contract=off"]


def say(message: str) -> None:
    """Print a line of the build; pip shows it with -v."""
    sys.stderr.write(f"stopgo: {message}\n")


def kernels() -> list[Extension]:
    """The extension modules; none where a pure wheel is wanted."""
    if os.environ.get("STOPGO_PURE"):
        return []
    return [_kernel(types) for types in TYPES] + [_extension(ARRAYS, "planner/geometry/arrays_compiled.c")]


def _kernel(types: Path) -> Extension:
    """The extension module of the kernel with these types."""
    source = types.with_name(types.name.replace("_compiled.pxd", ".py"))
    name = ".".join(("stopgo", *types.with_suffix("").parts))
    return _extension(name, source.as_posix(), depends=[types.as_posix()])


def _extension(name: str, source: str, **more: Any) -> Extension:
    return Extension(name, [source], extra_compile_args=FLAGS, optional=True, **more)


def _as_in_the_tree(one: Extension) -> Extension:
    """The extension with the name of its source's folders; the kernels import `ARRAYS` by its full name."""
    return Extension(one.name if one.name == ARRAYS else one.name.removeprefix("stopgo."), one.sources)


class BuildKernels(build_ext):
    """The compilation of the kernels, one on each processor; one that cannot be stays interpreted."""

    def finalize_options(self) -> None:
        super().finalize_options()
        self.parallel = self.parallel or True

    def run(self) -> None:
        if self.extensions:
            self._to_c()
        super().run()

    def _to_c(self) -> None:
        """Translate the kernels here only: pip loads this file three times, and builds once."""
        try:
            from Cython.Build import cythonize
        except ImportError:
            say("Cython is not installed, so the planner's kernels are not compiled")
            self.extensions = []
            return
        say(f"compiling {len(TYPES)} kernels, once; this takes some ten seconds")
        named = [_as_in_the_tree(one) for one in self.extensions]
        made = cythonize(
            named,
            compiler_directives=RULES,
            shared_utility_qualified_name=ARRAYS,
            build_dir="build/kernels",
            force=True,
            quiet=True,
        )
        for one, of_c in zip(self.extensions, made, strict=True):
            one.sources = of_c.sources


linked = [f"stopgo.{folder}{below}" for folder in FOLDERS for below in ("", ".*")]
own = find_packages(include=["stopgo", "stopgo.*"], exclude=linked)
mapped = [f"stopgo.{name}" for folder in FOLDERS for name in find_packages(include=[folder, f"{folder}.*"])]
setup(
    packages=[*own, *mapped],
    package_dir={f"stopgo.{folder}": folder for folder in FOLDERS},
    ext_modules=kernels(),
    cmdclass={"build_ext": BuildKernels},
)
