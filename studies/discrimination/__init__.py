"""Whether the verdict of a calibration tells right claims of what was cut from wrong ones."""
