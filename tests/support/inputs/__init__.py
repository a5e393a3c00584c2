"""Sound inputs of every kind that POSSE reads, and how each is damaged: what ``tests/fuzz`` tries."""
