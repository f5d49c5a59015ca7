"""The state of a simulation: its fields and tables, and what every kernel needs to read and write them."""
