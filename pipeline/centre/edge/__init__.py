"""Fit of a target's edge to the mixed pixels around it."""
