"""One module per file format, and the line and record parsers that they share."""
