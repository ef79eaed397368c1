"""The event-driven method: one engine for everything that is linear between events."""

from femimpact.integrators.event_driven.method import EventDriven

__all__ = ["EventDriven"]
