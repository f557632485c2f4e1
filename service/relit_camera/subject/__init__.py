"""The subject: a reflectance field in compressed form, its file, its store, and relighting it."""
