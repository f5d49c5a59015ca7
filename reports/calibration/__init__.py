"""Reports of calibrations: on one trace and of a study; figure of prior predictives."""
