"""Communication: messages, bytes, time, task contract, sockets, link model, ledger and log file.

Imports nothing else of ours.
"""
