"""Whether a food that was calibrated with one blade cuts alike under another."""
