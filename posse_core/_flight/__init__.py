"""Flights: from the camera through navigator and controller to the thrusters, and their record."""
