"""Tables of measured columns, and what their cells and units mean."""
