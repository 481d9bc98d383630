"""Fit of a target's edge to the mixed pixels around it, or where none are, to clean returns."""
