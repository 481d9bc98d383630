"""Batch processing of an archive: its captures, the run, the catalogue of its results."""
