"""Vehicles whose angles are known, and what a laser scanner would see of their wheels."""
