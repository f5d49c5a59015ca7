"""The fit: surrogate, search and multi-start under a budget of simulations."""
