"""Storage of inputs and results: local folders and object storage."""
