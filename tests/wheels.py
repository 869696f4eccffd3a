"""Builds the wheels and the source archive, and installs them in fresh environments, one per extra.

There are two wheels: one for this platform and Python, with the planner's kernels compiled, and one for every
machine without them, as robots need it. The former serves the extras that plan.

    python -m tests.wheels [PYTHON ...]

Each environment must plan, report what is missing, or record, as its extra promises; another package called
`mission` is put next to it and must change nothing. Takes minutes and downloads: not part of `make test`.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
OFFICE = ROOT / "recordings" / "samples" / "office.dxf"
PLAN = ("plan", str(OFFICE), "-o", "out")
CHECK = ("check", "out/mission.json", "--floor", str(OFFICE))
PROVE = ("prove", "out/mission.json", "--floor", str(OFFICE))
FINISHED = ("demo", "-o", "demo", "--speed-up", "1000")

EXTRAS: dict[str, Sequence[tuple[int, str, tuple[str, ...]]]] = {
    "": (
        (0, "stopgo", ("--help",)),
        (2, 'pip install "stopgo[plan]"', PLAN),
        (0, "valid", ("check", "mission.json")),
        (2, 'pip install "stopgo[site]"', ("site", "nowhere")),
    ),
    "plan": (
        (0, "mission.json", PLAN),
        (0, "valid", ("check", "out/mission.json", "--floor", str(OFFICE))),
        (2, 'pip install "stopgo[prove]"', PROVE),
    ),
    "prove": ((0, "mission.json", PLAN), (0, "promise is met", PROVE)),
    "record": ((2, 'pip install "stopgo[plan]"', PLAN), (2, "none.rrd", ("review", "none.rrd"))),
    "site": ((0, "plan.rrd", PLAN), (2, "nowhere: not a folder", ("site", "nowhere"))),
    "all": ((0, "plan.rrd", PLAN), (0, "FINISHED", FINISHED)),
}
"""For each extra: the exit code, a word that is printed, and the command."""


def main(pythons: Sequence[str]) -> int:
    """Build once, install everywhere; the number of environments that do not do what they promise."""
    with tempfile.TemporaryDirectory() as folder:
        compiled, pure = built(Path(folder))
        bad = [
            f"{python} [{extra}]: {problem}"
            for python in pythons
            for extra in EXTRAS
            for problem in problems(
                compiled if extra in PLANS and python == sys.executable else pure, python, extra, Path(folder)
            )
        ]
    for line in bad:
        print(line)
    return len(bad)


PLANS = ("plan", "prove", "site", "all")
"""Extras that get the wheel with compiled kernels, where it is of the environment's Python."""


def built(folder: Path) -> tuple[Path, Path]:
    """The platform's wheel and the one for every machine, once all hold what they must.

    Both are built from the source archive, of a tree without links.
    """
    tree = folder / "tree"
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    files = {name for name in listed.splitlines() if not (ROOT / name).is_symlink()}
    for name in files:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tree / name)
    run(sys.executable, "-m", "venv", str(folder / "builder"))
    run(str(folder / "builder" / "bin" / "pip"), "install", "-q", "build")
    build = (str(folder / "builder" / "bin" / "python"), "-m", "build", "--outdir")
    run(*build, str(folder), str(tree))
    (archive,) = folder.glob("*.tar.gz")
    shutil.unpack_archive(archive, folder / "source")
    (source,) = (folder / "source").iterdir()
    run(*build, str(folder / "pure"), "--wheel", str(source), STOPGO_PURE="yes")
    with tarfile.open(archive) as opened:
        held = {name.partition("/")[2] for name in opened.getnames()}
    assert files - {".gitignore"} <= held, files - held
    (wheel,), (pure,) = folder.glob("*.whl"), (folder / "pure").glob("*.whl")
    assert pure.name.endswith("-py3-none-any.whl"), pure.name
    held_by_pure = set(zipfile.ZipFile(pure).namelist())
    names = zipfile.ZipFile(wheel).namelist()
    machine_code = {name for name in names if "_compiled." in name and not name.endswith(".pxd")}
    kernels = len(list((ROOT / "planner").rglob("*_compiled.pxd")))
    assert len(machine_code) == kernels + 1, machine_code  # and what they share
    assert not [
        name for name in set(names) - held_by_pure if ".dist-info/" not in name and name not in machine_code
    ]
    top = {name.partition("/")[0] for name in names if ".dist-info/" not in name}
    assert top == {"stopgo"}, top
    for needed in (*REFERENCE, "recordings/samples/office.dxf", *PAGES, *TYPED):
        assert f"stopgo/{needed}" in names, needed
    print(f"{archive.name}: {len(held)} files; {wheel.name}: {len(names)} files", flush=True)
    return wheel, pure


REFERENCE = (
    "mission/mission.schema.json", "mission/canonical.vectors.json",
    "bridge/link/protocol.schema.json", "bridge/link/seal.vectors.json",
)  # fmt: skip
PAGES = tuple(f"site/pages/{path.name}" for path in (ROOT / "stopgo" / "site" / "pages").iterdir())
TYPED = tuple(f"{name}/py.typed" for name in ("mission", "planner", "bridge", "recordings"))


def problems(wheel: Path, python: str, extra: str, folder: Path) -> list[str]:
    """Broken promises of an environment with this extra."""
    place = Path(tempfile.mkdtemp(dir=folder))
    run(python, "-m", "venv", str(place / "venv"))
    ours = place / "venv" / "bin"
    run(str(ours / "pip"), "install", "-q", f"{wheel}[{extra}]" if extra else str(wheel))
    other = next((place / "venv" / "lib").glob("python*/site-packages")) / "mission"
    other.mkdir()
    (other / "__init__.py").write_text("raise RuntimeError('the other mission')\n")
    (place / "mission.json").write_bytes(sample_mission())
    bad = []
    for code, word, words in EXTRAS[extra]:
        done = subprocess.run(
            [str(ours / "stopgo"), *words],
            cwd=place,
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        told = done.stdout + done.stderr
        if done.returncode != code or word not in told or "Traceback" in told:
            bad.append(f"stopgo {' '.join(words)}: {done.returncode} {told[-400:]!r}")
    print(f"{python} [{extra}]: {'as promised' if not bad else f'{len(bad)} problems'}", flush=True)
    return bad


def sample_mission() -> bytes:
    """A mission to be read where nothing can be planned."""
    from stopgo.mission.files.mission_json import encode
    from tests.bridge.world import corridor

    return encode(corridor())


def run(*command: str, **environment: str) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **environment})


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or [sys.executable]))
