"""The core's own propagators: models of the motion, by the names that a scenario chooses from."""
