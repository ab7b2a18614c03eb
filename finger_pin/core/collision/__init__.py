"""Collision detection within steps: bounds of motion, culling of contact pairs, and a search for missed contacts."""
