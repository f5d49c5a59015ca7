"""From a file to a conditioned force curve over stroke."""
