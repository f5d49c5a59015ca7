"""Pictures drawn in software: geometry once, then the light of each background; needs no graphics device."""
