"""Formats that all reports share: numbers, tables, translations, letterhead."""
