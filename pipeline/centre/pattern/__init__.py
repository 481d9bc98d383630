"""Pose of a printed pattern from the intensities of a target's points."""
