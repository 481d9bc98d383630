"""Centre of a target from its printed pattern: detection, refinement, pose."""
