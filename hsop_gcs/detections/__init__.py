"""Detections: what the hosts' cameras see, brought into the picture. Pure: every function returns new values."""

from hsop_gcs.detections.assimilate import Assimilated, Counts, Fate, Verdict, Watch, assimilate, let_go, rays_of
from hsop_gcs.detections.detection import Detection, Direction, Lens, Pixel, Refused
from hsop_gcs.detections.poses import Pose, PoseHistory
from hsop_gcs.detections.ray import Ray, to_ray
from hsop_gcs.detections.rules import DetectionRules

__all__ = [
    "Assimilated",
    "Counts",
    "Detection",
    "DetectionRules",
    "Direction",
    "Fate",
    "Lens",
    "Pixel",
    "Pose",
    "PoseHistory",
    "Ray",
    "Refused",
    "Verdict",
    "Watch",
    "assimilate",
    "let_go",
    "rays_of",
    "to_ray",
]
