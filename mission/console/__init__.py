"""Shared parts of all commands: the process and its signals, tables, JSON answers, plug-ins and ports."""
