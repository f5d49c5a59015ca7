"""Verification: cases with a closed form or an independent reference, what the solver gives, and how far it may be off."""
