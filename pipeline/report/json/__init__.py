"""The report as JSON: measurement.json and the result of a validation."""
