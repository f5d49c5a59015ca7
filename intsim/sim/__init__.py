"""The cut inside the robot simulator."""
