"""Subjects: the reflectance field of a person, its compression, the subject file, the store, and relighting."""
