"""Studies of the solver that no fit needs: verification, convergence, stability, regression, speed."""
