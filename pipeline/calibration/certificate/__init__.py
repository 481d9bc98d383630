"""Certificate of a calibration: its file, what it lacks, standards past their due dates."""
