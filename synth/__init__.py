"""Generator of synthetic laser scans of vehicles whose wheel angles are known."""
