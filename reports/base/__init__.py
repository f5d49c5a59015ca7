"""What all reports share: format, labels, figures, pictures."""
