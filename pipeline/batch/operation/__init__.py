"""What an operator asks of a run: its state, the time of each capture, why one failed."""
