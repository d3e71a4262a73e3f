"""Contouring control: designed, judged by the exact contour error, and shipped to real time."""
