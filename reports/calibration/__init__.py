"""Reports of calibrations: on one trace and of a study; figures of a compression test and of prior predictives."""
