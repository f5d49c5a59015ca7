"""The cameras of a dataset's pictures and of its exports."""

from intsim.render.view import PICTURE_CAMERAS

CAMERA_NAMES = PICTURE_CAMERAS[:3]
"""Cameras of the published datasets, in the order in which an export has their pictures."""
WORK_CAMERA = PICTURE_CAMERAS[3]
"""A close one, which an export has where it is asked for."""
