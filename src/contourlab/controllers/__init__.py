"""Discrete control laws, one file each."""
