"""The time step in Taichi's language."""
