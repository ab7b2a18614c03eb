"""Paths of the tendons in space: parallel lanes and windings around the joints."""

from finger_pin.mechanism.geometry.fingers import Pulley, Visual
from finger_pin.mechanism.geometry.lateral_offsets import joint_axes
from finger_pin.mechanism.geometry.tendon_geometry import LinkPoses, TendonGeometry, TendonPath, tendon_paths
from finger_pin.mechanism.geometry.tree_geometry import TreeGeometry
from finger_pin.mechanism.geometry.wound_tendon import BASE_LEAD

__all__ = [
    "BASE_LEAD",
    "LinkPoses",
    "Pulley",
    "TendonGeometry",
    "TendonPath",
    "TreeGeometry",
    "Visual",
    "joint_axes",
    "tendon_paths",
]
