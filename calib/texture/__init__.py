"""Tests in time between two plates: bites of a texture profile, holds that relax, and the laws that repeats follow.

Way and load are positive in compression. Strain is way over height, stress is load over the first area: both are
engineering quantities.
"""
