"""Frames of a site: transforms, rigid fits and geodesy."""
