"""The command line: a module for each command.

Such a module imports what its options need, which is little, and each function imports what it works
with. So the help of every command appears without waiting for numerical libraries to be imported.
"""
