"""The version of cutcal."""

__version__ = "0.2.0"
