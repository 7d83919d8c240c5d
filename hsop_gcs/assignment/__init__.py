"""Assignment: which host flies to which hover point, and the order each one gets. Pure."""

from hsop_gcs.assignment.matching import assign
from hsop_gcs.assignment.orders import HostOrder, Mover, NoSafeFlight, orders_for

__all__ = ["HostOrder", "Mover", "NoSafeFlight", "assign", "orders_for"]
