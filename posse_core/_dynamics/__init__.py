"""Orbits and relative motion: named, serialisable casadi Functions, and wrappers for whole arrays."""
