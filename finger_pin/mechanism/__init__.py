"""Coordinates and rows: rigid body, tendons, frictions, limiters and their wiring; URDF and MJCF. No time."""
