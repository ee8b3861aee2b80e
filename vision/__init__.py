"""Pixels in, angle out: the cable tracker, its offset table and filters, and the vision task."""
