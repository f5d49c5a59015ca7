"""What a robot does with a calibrated food: cutting tasks in words, planned cuts, and whether they part the food.

The rooms depend on each other one way: ``task`` (words, targets, plans, success) < ``sim`` (the robot and the food)
< ``data`` (demonstrations and their exports) < ``policy`` (oracles, networks, models of others) < ``evaluate``. Of the
other packages only the command line, ``cutcal``, imports this one.

Lengths in m, angles in rad, forces in N, times in s.
"""

import warnings

# SAPIEN warns in every worker that it brings a Vulkan library of its own; ``cutcal doctor`` says what works.
warnings.filterwarnings("ignore", message="Failed to find system libvulkan")
