"""The cameras of a dataset's pictures."""

CAMERA_NAMES = ("front", "side", "wrist")
"""Cameras of the robot's environment, in the order in which a dataset and its exports have their pictures."""
