"""Communication: messages, bytes, time, task contract, sockets, link model, ledger and log file.

Imports no other package of the project.
"""
