"""The scene before the scanner: target, wheel, vehicle body, workshop, as triangles."""
