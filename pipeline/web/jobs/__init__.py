"""Jobs of the page: a queue of processes that measure, compare and write reports."""
