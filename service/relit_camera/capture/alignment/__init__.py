"""Alignment of photographs of a face to each other, so that one texel shows one place of the skin."""
