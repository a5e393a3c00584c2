"""The scenario: everything that defines a run, as YAML or a mapping."""
