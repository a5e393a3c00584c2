"""The command line: a module for each command.

At its top, such a module imports only what its options need; each function imports the rest itself.
So the help of every command appears without importing numerical libraries.
"""
