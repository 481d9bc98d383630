"""The local page: load a capture, look at its angles, save its report."""
