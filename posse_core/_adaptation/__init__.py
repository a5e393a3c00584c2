"""Carrying the nets of a recipe on with images of the domain that they are to work in."""
