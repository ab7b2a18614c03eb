"""Coordinates and rows: rigid body, tendons, frictions, limiters, how they are joined; URDF and MJCF. No time."""
