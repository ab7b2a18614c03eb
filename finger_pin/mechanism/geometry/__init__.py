"""Paths of the tendons in space: parallel lanes, windings around the joints, and legs between points."""

from finger_pin.mechanism.geometry.cord_pieces import LinkPoses
from finger_pin.mechanism.geometry.lateral_offsets import joint_axes
from finger_pin.mechanism.geometry.tendon_geometry import TendonGeometry, TendonPath, tendon_paths
from finger_pin.mechanism.geometry.visuals import Visual
from finger_pin.mechanism.geometry.wound_tendon import BASE_LEAD

__all__ = ["BASE_LEAD", "LinkPoses", "TendonGeometry", "TendonPath", "Visual", "joint_axes", "tendon_paths"]
