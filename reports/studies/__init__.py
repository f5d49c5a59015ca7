"""Reports of what was studied of the solver: convergence, verification, stability, speed."""
