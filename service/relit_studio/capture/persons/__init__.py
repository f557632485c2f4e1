"""Persons in front of the phone: rendered ones, and ones with a known reflectance field."""
