"""Reports of tests between two plates: compression, relaxation, texture profile."""
