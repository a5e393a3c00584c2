"""The scenario: a YAML file that says everything about a run."""
