"""A wedge that drives a crack: cohesive plane, split beam, cut of a block, and the energy that they release."""
