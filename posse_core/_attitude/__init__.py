"""Attitude laws of the target's body and of the chaser's camera."""
