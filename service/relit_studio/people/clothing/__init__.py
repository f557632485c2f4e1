"""What a person wears: shirt, collar and glasses."""
