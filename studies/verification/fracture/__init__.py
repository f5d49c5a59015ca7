"""Cases of a crack that obeys its own law: beams split by a wedge, the work of new surface, cuts by finite elements."""
