"""What a robot does with a calibrated food: cutting tasks in words, planned cuts, and whether they part the food.

Nothing else imports this package. Lengths in m, angles in rad, forces in N, times in s.
"""
