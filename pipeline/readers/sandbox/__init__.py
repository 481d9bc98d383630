"""Native decoders in a child process with bounds on memory and time: client, process, worker."""
