"""Files of all known kinds as tables of measured columns."""
