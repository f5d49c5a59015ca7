"""Finite-element reference of the solver (scikit-fem). Knows nothing of Taichi."""
