"""Run time against error, what each economy brings, and the textbook kernel to compare with."""
