"""Bare wheels as they are: tyre, rim, brake behind the spokes, run-out, and what lies on them."""
