"""Local web page: load a capture, view its angles, save its report."""
