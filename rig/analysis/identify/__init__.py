"""Identification: arrays in, estimates with standard deviation out; works on data of other labs.

Imports nothing of ours outside this folder.
"""
