"""Intervals: profile likelihood, posterior sample, global search, sensitivity, predictive bands."""
