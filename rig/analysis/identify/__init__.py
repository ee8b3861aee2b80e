"""Identification: arrays in, estimates with standard deviation out; works on data of other labs.

Imports no package of this project outside this folder.
"""
