"""Foods, knives and the scenes that they make."""
