"""Single pictures of people, and whether public face models recognize them."""
