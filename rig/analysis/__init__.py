"""Analysis of a run: a log in, numbers with uncertainty and a verdict out.

Imports planners and comms. The estimators themselves are in identify/ and know no log.
"""
