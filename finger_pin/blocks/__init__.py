"""The boxes of Fig. 5, one file each."""
