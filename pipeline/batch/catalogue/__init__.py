"""Catalogue of results: an SQLite index of the results' JSON files."""
