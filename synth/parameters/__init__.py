"""Parameter files of the generator: vehicles, scanners, targets, and random draws."""
