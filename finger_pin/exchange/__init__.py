"""Models of other programs: URDF, MJCF, MuJoCo and Pinocchio, read and written."""
