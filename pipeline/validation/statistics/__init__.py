"""Statistics of method comparison: joint test, limits of agreement, line fit, power."""
