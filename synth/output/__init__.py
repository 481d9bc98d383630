"""Files that the generator writes: scans, capture.toml, five points and truth.json."""
