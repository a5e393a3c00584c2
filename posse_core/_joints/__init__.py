"""The built-in laws that move joints."""
