"""Verification: cases with a closed form or an independent reference, and how far the solver may be off."""
