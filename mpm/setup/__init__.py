"""From a scene to what a run begins with: particles, grid, time step and tables."""
