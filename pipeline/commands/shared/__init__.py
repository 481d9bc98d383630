"""Options, limits, progress and output that several commands share."""
