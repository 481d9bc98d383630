"""The synthetic vehicle: wheels, angles, steering, run-out, body."""
