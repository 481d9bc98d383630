"""Catalogue of the results of a batch: an SQLite index of all measurements."""
