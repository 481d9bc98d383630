"""Pulls on a plane of how the points of a scan were thinned: on voxels, to a least distance."""
