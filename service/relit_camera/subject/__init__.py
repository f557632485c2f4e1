"""The reflectance field of a person, its compressed form, the subject file and the store."""
