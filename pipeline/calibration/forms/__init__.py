"""Forms of a calibration: the item's file, the table of readings, and empty ones to fill in."""
