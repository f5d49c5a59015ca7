"""Datasets of cuts: which episodes there are, how they are made, how they are stored, and other formats."""
