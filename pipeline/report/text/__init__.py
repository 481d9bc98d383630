"""The report as text for the terminal and report.txt."""
