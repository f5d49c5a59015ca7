"""Particles and grid of a scene."""
