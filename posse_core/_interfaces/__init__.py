"""What a component of each kind must do: one abstract class for each kind.

Every component class is called with one argument, its validated options
(:class:`posse_core.Options`). What its record may claim beyond its interface is listed in
``posse_core/_plugins/kinds.py`` and by ``posse describe KIND``. The conformance kit in
:mod:`posse_core.testing` checks that a component keeps its promises.
"""
