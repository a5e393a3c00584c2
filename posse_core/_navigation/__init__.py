"""The built-in navigators."""
