"""Candidates of an explanation: pictures, text, plain data."""
