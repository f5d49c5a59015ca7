"""Fits to published peaks and energies where there is no trace."""
