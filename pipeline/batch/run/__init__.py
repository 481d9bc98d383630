"""Run of a batch: tasks, worker processes, progress, the ledger of runs, and the summary."""
