"""The rungs of the ladder, instant, desk and film, compared on people whose reflectance field is known."""
