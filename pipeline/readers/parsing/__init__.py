"""Parsing that several formats share: tables and lines of text, binary records, LZF."""
