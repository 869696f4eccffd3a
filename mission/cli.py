"""Commands of this folder."""

from __future__ import annotations

import typer


def add_commands(app: typer.Typer) -> None:
    """Add this folder's verbs to the front door."""
