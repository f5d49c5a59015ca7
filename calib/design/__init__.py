"""The next experiment: which test of a food narrows what is asked of it most."""
