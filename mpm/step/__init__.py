"""The order of a time step, above the kernels that it is made of."""
