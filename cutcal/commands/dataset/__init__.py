"""Commands of the robot path: datasets and the evaluation of policies."""
