"""Relaxation under a plate that holds: the hold of a record, its Prony series, and what the record tells of that."""
