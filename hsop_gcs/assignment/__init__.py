"""Assignment: which host flies to which hover point, by which route, and the order each one gets. Pure."""

from hsop_gcs.assignment.matching import assign
from hsop_gcs.assignment.orders import HostOrder, NoSafeFlight, flight_s, order_for, orders_for
from hsop_gcs.assignment.routes import Mover, clearance_m, safe_route

__all__ = [
    "HostOrder",
    "Mover",
    "NoSafeFlight",
    "assign",
    "clearance_m",
    "flight_s",
    "order_for",
    "orders_for",
    "safe_route",
]
