"""Convergence over the grid: the study, and the grid convergence index."""
