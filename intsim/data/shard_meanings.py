"""What each data set of a dataset's HDF5 files is."""

from __future__ import annotations

from calib.io.meaning import NO_UNIT, UNKNOWN, Meaning

JOINTS = "rad, m"
"""Unit of the seven joints of an arm and the two fingers of its hand."""
POSE = "m, rad"
"""Unit of places and angles in one row."""
GROUP = "What the food did in a trajectory, and what it was made with"
GROUP_ATTRIBUTES = {
    "food": Meaning(NO_UNIT, "name of the food that is cut"),
    "material": Meaning(NO_UNIT, "its properties by name, in SI units, as JSON"),
    "material_sha256": Meaning(NO_UNIT, "SHA-256 of these properties"),
    "solver_sha256": Meaning(NO_UNIT, "version of the solver's code"),
    "knife": Meaning(NO_UNIT, "name of the knife"),
    "arm": Meaning("N m/rad", "stiffness of the arm's joints, null for the usual one, as JSON"),
    "contact_step": Meaning(NO_UNIT, "first step in which the knife touches the food, -1 without contact"),
}
"""Attributes of the group ``mpm`` of a trajectory."""

COLUMNS = {
    "actions": Meaning(JOINTS, "targets of the seven joints, and the gripper from -1 closed to 1 open", "(T, 8)"),
    "obs/agent/qpos": Meaning(JOINTS, "joints of arm and fingers", "(T + 1, 9)"),
    "obs/agent/qvel": Meaning("rad/s, m/s", "velocities of the joints", "(T + 1, 9)"),
    "obs/extra/edge": Meaning(POSE, "edge of the knife: x, y, z, direction, angle to the board", "(T + 1, 5)"),
    "success": Meaning(NO_UNIT, "whether the published criteria are met and the food is in pieces", "(T,)"),
    "terminated": Meaning(NO_UNIT, "always false: a trajectory goes on to its last step", "(T,)"),
    "truncated": Meaning(NO_UNIT, "whether it is the last step", "(T,)"),
    "control/command": Meaning(POSE, "commanded pose of the edge", "(T, 5)"),
    "control/delta": Meaning(POSE, "commanded less present pose: x, y, z, roll, pitch, yaw; and the gripper", "(T, 7)"),
    "control/phase": Meaning(NO_UNIT, "approach 0, contact 1, cut 2, hold 3, retract 4", "(T,)"),
    "mpm/force": Meaning(
        "N", "force of the food on the knife, world axes, in each step of the robot's model", "(T, 5, 3)"
    ),
    "mpm/force_control": Meaning("N", "its mean over a step", "(T, 3)"),
    "mpm/impulse": Meaning("N s", "its impulse so far", "(T, 3)"),
    "mpm/touching": Meaning(NO_UNIT, "whether the knife touches the food", "(T,)"),
    "mpm/uncut": Meaning(NO_UNIT, "part of the section that holds", "(T,)"),
    "mpm/pieces": Meaning(NO_UNIT, "number of pieces of the food", "(T,)"),
    "mpm/severed": Meaning(NO_UNIT, "whether the food is in pieces", "(T,)"),
    "mpm/published": Meaning(NO_UNIT, "whether the published criteria are met", "(T,)"),
}
"""Data sets of a trajectory of T steps."""

SURFACE = {
    "step": Meaning(NO_UNIT, "steps after which the surface was kept", "(F,)"),
    "vertices": Meaning("m", "points of the surface, less the attribute origin", "(F, m, 3)"),
    "triangles": Meaning(NO_UNIT, "numbers of the three points of each triangle", "(t, 3)"),
    "flesh": Meaning(NO_UNIT, "whether a point is on the face of the cut", "(m,)"),
}
"""Data sets of ``mpm/surface/C``, the food under the knife in cut C, F times."""


def meaning_of(path: str) -> Meaning:
    """What a data set of a trajectory is.

    Args:
        path: Its path within the trajectory, such as ``mpm/force``.

    Returns:
        Its unit and meaning.
    """
    if path.startswith("mpm/surface/"):
        return SURFACE.get(path.rpartition("/")[2], UNKNOWN)
    return COLUMNS.get(path, UNKNOWN)


def picture_meaning(camera: str) -> Meaning:
    """What the data set of a camera is.

    Args:
        camera: Name of the camera.

    Returns:
        Its unit and meaning.
    """
    return Meaning(NO_UNIT, f"what the camera {camera} sees before each step, a PNG file each", "(T,)")
