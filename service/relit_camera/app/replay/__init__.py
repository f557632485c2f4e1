"""Relighting recorded videos."""
