"""Files that the page may read: allowed folders, uploads, excerpts."""
