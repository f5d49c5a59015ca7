"""Commands that run and examine the solver."""
