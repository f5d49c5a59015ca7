"""One calibration: a trace in, fitted parameters and their documents out."""
