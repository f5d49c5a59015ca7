"""Running simulations: evaluations, worker processes, clusters, and the store of what was run."""
