"""Photographs of a spacecraft that a person labels: clicked points, and the poses that they give."""
