"""Stability: where the solver is stable, and why it ends where it is not."""
