"""How a generic head answers light, and what rendered people taught about it."""
