"""Corners of meshes by formula, m."""

import itertools

import numpy as np


def ring(corners=48):
    """Return points on a circle of radius 1 about z."""
    turns = 2.0 * np.pi * np.arange(corners) / corners
    return np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=-1)


def ball(rings=32):
    """Return points on a ball of radius 1."""
    polar = np.linspace(0.0, np.pi, rings)
    return np.concatenate([np.sin(angle) * ring() + [0.0, 0.0, np.cos(angle)] for angle in polar])


def box(x, y, z):
    """Return the corners of a box with sides."""
    return 0.5 * np.array(list(itertools.product((-x, x), (-y, y), (-z, z))))


def tapered(first, second, length):
    """Return points on two balls with radii, from z = 0 to a length: their hull is a capsule if the radii are equal."""
    return np.concatenate([first * ball(), second * ball() + [0.0, 0.0, length]])


def mesh(name, points):
    """Return a mesh of MJCF that is the hull of points."""
    return f'<mesh name="{name}" vertex="{" ".join(f"{each:.9g}" for each in np.ravel(points))}"/>'
