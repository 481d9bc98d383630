"""Captures of an archive, their identity, and the settings they are measured with."""
