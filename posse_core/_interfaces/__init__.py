"""What a component of each kind must do: one abstract class a kind.

Every component class is called with one argument, its validated options
(:class:`posse_core.Options`). The conformance kit in :mod:`posse_core.testing` checks that a component
keeps its promises.
"""
