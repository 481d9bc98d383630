"""Content of the web page: what can be chosen, measured, compared and viewed."""
