"""A stone in the food: nodes that move as one rigid body, and the blade that cannot enter it."""
