"""Parts of the report of a study of several cuts: verdicts, what was fitted, the model."""
