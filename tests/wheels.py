"""Builds the wheel and the source archive, and installs the wheel in fresh environments, one per extra.

    python -m tests.wheels [PYTHON ...]

Each environment must plan, tell what is missing, or record, as its extra promises; another package called
`mission` is put beside it and must change nothing. Takes minutes and downloads: not part of `make test`.
"""

from __future__ import annotations

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
        (0, "in order", ("check", "mission.json")),
    ),
    "plan": (
        (0, "mission.json", PLAN),
        (0, "in order", ("check", "out/mission.json", "--floor", str(OFFICE))),
        (2, 'pip install "stopgo[prove]"', PROVE),
    ),
    "prove": ((0, "mission.json", PLAN), (0, "promise is met", PROVE)),
    "record": ((2, 'pip install "stopgo[plan]"', PLAN), (2, "none.rrd", ("review", "none.rrd"))),
    "all": ((0, "plan.rrd", PLAN), (0, "FINISHED", FINISHED)),
}
"""For each extra: the exit code, a word that is printed, and the command."""


def main(pythons: Sequence[str]) -> int:
    """Build once, install everywhere; the number of environments that do not do what they promise."""
    with tempfile.TemporaryDirectory() as folder:
        wheel = built(Path(folder))
        bad = [
            f"{python} [{extra}]: {problem}"
            for python in pythons
            for extra in EXTRAS
            for problem in problems(wheel, python, extra, Path(folder))
        ]
    for line in bad:
        print(line)
    return len(bad)


def built(folder: Path) -> Path:
    """The wheel, built from the source archive, once both hold what they must."""
    tree = folder / "tree"
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    links = {name for name in listed.splitlines() if (ROOT / name).is_symlink()}
    for name in set(listed.splitlines()) - links:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tree / name)
    run(sys.executable, "-m", "venv", str(folder / "builder"))
    run(str(folder / "builder" / "bin" / "pip"), "install", "-q", "build")
    run(str(folder / "builder" / "bin" / "python"), "-m", "build", "--outdir", str(folder), str(tree))
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        held = {name.partition("/")[2] for name in opened.getnames()}
    packed = set(listed.splitlines()) - links - {".gitignore"}
    assert packed <= held, packed - held
    (wheel,) = folder.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    top = {name.partition("/")[0] for name in names if ".dist-info/" not in name}
    assert top == {"stopgo"}, top
    for needed in (*REFERENCE, "recordings/samples/office.dxf", *TYPED):
        assert f"stopgo/{needed}" in names, needed
    print(f"{archive.name}: {len(held)} files; {wheel.name}: {len(names)} files", flush=True)
    return wheel


REFERENCE = (
    "mission/mission.schema.json", "mission/canonical.vectors.json",
    "bridge/link/protocol.schema.json", "bridge/link/seal.vectors.json",
)  # fmt: skip
TYPED = tuple(f"{name}/py.typed" for name in ("mission", "planner", "bridge", "recordings"))


def problems(wheel: Path, python: str, extra: str, folder: Path) -> list[str]:
    """What an environment with this extra does not do as promised."""
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


def run(*command: str) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or [sys.executable]))
