"""The same frames by several renderers, held against exact geometry, closed forms, and each other."""
