"""Refinement of poses by comparing an image with what would be seen."""
