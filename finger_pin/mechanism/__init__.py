"""The room mechanism."""
