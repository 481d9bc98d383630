"""Centre of a target from its edge: beams, mixed pixels, and the fit of the outline."""
