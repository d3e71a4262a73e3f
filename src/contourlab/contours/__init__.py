"""Curves as geometry."""
