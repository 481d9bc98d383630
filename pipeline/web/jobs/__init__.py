"""Jobs of the web page: the queue, and the child process that runs each measurement."""
