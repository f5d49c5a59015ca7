"""Policies: oracles, published models, behaviour cloning."""
