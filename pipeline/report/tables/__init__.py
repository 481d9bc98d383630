"""Tables of a measurement, defined once for the page and for plain text."""
