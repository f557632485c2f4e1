"""Traits of a person: named people and random ones."""
