"""A person-like bust made by code alone, its pictures under any light, and the truth of all of it."""
