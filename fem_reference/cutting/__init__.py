"""A blade through a block along a plane that parts by a law of its own, and Griffith's crack beside it."""
