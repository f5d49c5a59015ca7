"""The version of cutcal."""

__version__ = "0.1.0"
