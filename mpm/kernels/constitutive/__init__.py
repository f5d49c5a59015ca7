"""What a particle does with its strain: laws of the flesh, the update of its stress, and bulk damage."""
