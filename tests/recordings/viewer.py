"""Looks at every view of a tab of a headless viewer."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from rerun.experimental import View, ViewerClient

from stopgo.recordings.viewing.headless import (
    PATIENCE_S,
    REDRAW_S,
    container,
    has_vulkan,
    outermost,
    take_picture,
    view_name,
    viewer,
)

__all__ = ["PATIENCE_S", "has_vulkan", "look", "show_tab", "viewer"]


def show_tab(client: ViewerClient, name: str) -> set[str]:
    """Bring this part of the outermost tabs to the front; returns the ids of the views to be seen."""
    parts = client.get_blueprint().blueprint
    tabs = str(outermost(parts))
    for part in container(parts, tabs)["contents"]:
        if name in (container(parts, f"/{part}").get("display_name"), view_name(parts, f"/{part}")):
            container(parts, tabs)["active_tab"] = part
            client.set_blueprint(parts, of="recording")
            return _views(parts, part)
    raise AssertionError(f"no tab {name}")


def look(client: ViewerClient, tab: str, into: Path) -> dict[str, tuple[View, Path]]:
    """Each view of a tab by its name, with what it reported, and its picture."""
    shown = show_tab(client, tab)
    time.sleep(REDRAW_S)
    pictures = {}
    for view in client.get_state().views:
        if view.view_id in shown:
            pictures[view.view_id] = into / f"{view.view_id}.png"
            take_picture(client, view.view_id, pictures[view.view_id])
    views = [view for view in client.get_state().views if view.view_id in shown]
    return {view.name: (view, pictures[view.view_id]) for view in views}


def _views(parts: dict[str, Any], part: str) -> set[str]:
    """Ids of the views to be seen in a container: of tabs, only those of the tab in front."""
    kind, _, name = part.partition("/")
    if kind == "view":
        return {name}
    held = container(parts, f"/{part}")
    inside = [held["active_tab"]] if held["container_kind"] == "Tabs" else held["contents"]
    return set().union(*(_views(parts, item) for item in inside))
