"""Records in time between two plates: bites, texture profiles, Prony series, and the law that several speeds follow.

Way and load are positive in compression. Strain is way over height, stress is load over the first area: both are
engineering quantities.
"""
