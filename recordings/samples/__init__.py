"""Inputs that ship with stopgo, drawn by the project itself."""
