"""The interactive 3-D scene of the report: vehicle, wheels, targets and points."""
