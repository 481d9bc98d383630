"""The simulated laser scanner: beams, footprint, noise, stations."""
