"""Views of a folder of batch results."""
