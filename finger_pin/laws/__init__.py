"""The laws of force, one per file: value, slopes, stored energy, lost power."""
