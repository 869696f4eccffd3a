"""Folder of a site: floors, missions and recordings in it; no path that a page names leads out of it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import InputError
from stopgo.mission.files.file_name import NOT_TEXT, UNREADABLE, legible_name
from stopgo.mission.files.mission_json import read

FLOORS = (".dxf", ".ifc", ".ifczip", ".ifcxml")
MOST_FILES, MOST_FOLDERS = 500, 5000
"""Most missions that a page lists; most folders that are looked into."""
LONGEST_NAME = 1024


@dataclass(frozen=True)
class SiteFiles:
    """The folder that a site works in."""

    root: Path

    @classmethod
    def at(cls, root: Path) -> SiteFiles:
        """Return the folder; raises `InputError` if it is none."""
        if not root.is_dir():
            raise InputError(f"{root}: not a folder; give the folder with the site's floors and plans")
        return cls(root.resolve())

    def file(self, name: str) -> Path:
        """Return the path of an existing file of the folder.

        Raises
        ------
        InputError
            If it is none, or lies outside.
        """
        path = self.path(name)
        if not path.is_file():
            problem = NOT_TEXT if UNREADABLE in name else "no such file in the site's folder"
            raise InputError(f"{name[:100]!r}: {problem}")
        return path

    def plain(self, text: str) -> str:
        """Return a text with the folder's files by their names in it: where it lies is nobody's business."""
        inside = text.replace(f"{self.root}{os.sep}", "")
        return re.sub(rf"{re.escape(str(self.root))}(?![\w.-])", "the site's folder", inside)

    def path(self, name: str) -> Path:
        """Return the path of a name in the folder, whether it exists or not; links must stay inside, too."""
        given = Path(name)
        bad = not name or len(name) > LONGEST_NAME or "\0" in name or "\\" in name
        if bad or given.is_absolute() or ".." in given.parts or any(p.startswith(".") for p in given.parts):
            raise InputError(f"{name[:100]!r}: not a file of the site's folder")
        try:
            path = (self.root / given).resolve()
        except (OSError, RuntimeError):
            raise InputError(f"{name[:100]!r}: not a file of the site's folder") from None
        if not path.is_relative_to(self.root):
            raise InputError(f"{name[:100]!r}: leads out of the site's folder")
        return path

    def name_of(self, path: Path) -> str:
        """Return the name of a path of the folder."""
        return path.relative_to(self.root).as_posix()

    def floors(self) -> list[str]:
        """Return the floors' files, by name.

        Raises
        ------
        InputError
            If the folder is not there any more.
        """
        return sorted(name for name in self._walk() if _is_floor(name))

    def missions(self) -> tuple[list[dict[str, Any]], int]:
        """Return the newest missions in the folder, the newest first, and how many are left out.

        Raises
        ------
        InputError
            If the folder is not there any more.
        """
        files = []
        for name in self._walk():
            if Path(name).name.startswith("mission") and name.endswith(".json"):
                with suppress(OSError):
                    files.append((-(self.root / name).stat().st_mtime, name))
        found = []
        for _, name in sorted(files)[:MOST_FILES]:
            with suppress(InputError, OSError):
                found.append(_mission_json(name, read(self.root / name)))
        return found, max(0, len(files) - MOST_FILES)

    def _walk(self) -> Iterator[str]:
        if not self.root.is_dir():
            raise InputError(
                "the site's folder is not there; bring it back, or start stopgo site with another"
            )
        for count, (folder, below, names) in enumerate(os.walk(self.root)):
            below[:] = sorted(name for name in below if not name.startswith("."))
            if count >= MOST_FOLDERS:
                return
            for name in names:
                if not name.startswith(".") and Path(folder, name).is_file():
                    yield legible_name(self.name_of(Path(folder, name)))


def _is_floor(name: str) -> bool:
    return name.lower().endswith(FLOORS) or _is_robots_map(name)


def _is_robots_map(name: str) -> bool:
    return Path(name).name == "map.yaml"


def _mission_json(name: str, mission: Mission) -> dict[str, Any]:
    return {
        "file": name, "id": mission.id, "revision": mission.revision, "name": mission.name,
        "stops": len(mission.stops), "total_s": schedule(mission).total_s, "floor": mission.origin.floor,
    }  # fmt: skip


def mission_difference(held: Mission | None, new: Mission) -> dict[str, Any]:
    """Return what a push would change for a robot that holds a mission, or none."""
    about = {
        "id": new.id, "revision": new.revision, "name": new.name, "stops": len(new.stops),
        "digest": new.digest,
    }  # fmt: skip
    if held is None:
        return {"new": about, "held": None, "same": False}
    before = {(one.x, one.y): one for one in held.stops}
    after = {(one.x, one.y): one for one in new.stops}
    return {
        "new": about | {"total_s": schedule(new).total_s},
        "held": {
            "id": held.id, "revision": held.revision, "name": held.name, "stops": len(held.stops),
            "total_s": schedule(held).total_s, "digest": held.digest,
        },
        "same": held.digest == new.digest,
        "same_mission": held.id == new.id,
        "added": [one.id for place, one in after.items() if place not in before],
        "removed": [one.id for place, one in before.items() if place not in after],
        "kept": sum(place in before for place in after),
    }  # fmt: skip
