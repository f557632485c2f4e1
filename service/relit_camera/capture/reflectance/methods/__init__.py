"""The reflectance methods, each chosen by name: interpolations, fitted functions, the appearance model, their blend."""
