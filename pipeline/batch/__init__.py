"""Many captures: what there is to do, doing it, and what came of it."""
