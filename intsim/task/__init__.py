"""Cutting tasks: words, targets, plans, success."""
