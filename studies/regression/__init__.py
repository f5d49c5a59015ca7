"""Regression: recorded force curves, and what a cut gives today against them."""
