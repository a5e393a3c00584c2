"""Attitude laws: where the target's body and the chaser's camera point."""
