"""Data of every stage of stopgo, and the files it is written to. Imports nothing else of the project."""

__version__ = "0.1.0"
"""That of pyproject.toml; asking the installation for it takes 30 ms."""
