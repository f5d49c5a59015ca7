"""Several specimens of one food in one fit: the study file, joint runs, held-out cuts."""
