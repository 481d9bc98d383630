"""Reports of a measurement: text, JSON, HTML, PDF and plots."""
