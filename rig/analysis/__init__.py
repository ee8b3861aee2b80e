"""Analysis of a run: a log in, numbers with uncertainty and a verdict out.

Imports planners and comms. The estimators are in identify/ and take arrays, not logs.
"""
