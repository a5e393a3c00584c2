"""The built-in attitude laws."""
