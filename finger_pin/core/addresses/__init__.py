"""Addresses of compiled laws, shapes and functions of time."""
