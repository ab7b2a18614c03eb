"""The room description."""
