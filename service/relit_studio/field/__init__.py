"""Reflectance fields: pictures of a person under single lights over the whole sphere."""
