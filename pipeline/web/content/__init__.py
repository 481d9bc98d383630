"""Content of the page: measurements, comparisons, reports, archives of results."""
