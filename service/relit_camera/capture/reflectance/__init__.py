"""Reflectance methods: from samples to a reflectance field, by interpolation or by models of appearance."""
