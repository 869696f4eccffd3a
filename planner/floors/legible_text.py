"""Texts from files, as a terminal and a document can show them."""

from __future__ import annotations


def legible(text: str, *, most: int = 120) -> str:
    """Return text from a file as one line that every terminal and file accepts."""
    line = " ".join(text.split())
    if line.isprintable():
        return line[:most]
    sound = text.encode("utf-8", errors="replace").decode("utf-8")
    line = " ".join(sound.split())
    return "".join(letter if letter.isprintable() else "?" for letter in line)[:most]
