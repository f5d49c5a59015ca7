"""Commands that list what is known, and look after the installation."""
