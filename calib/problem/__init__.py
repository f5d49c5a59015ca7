"""The problem that a fit solves: parameters, nuisance parameters, objective, set-up."""
