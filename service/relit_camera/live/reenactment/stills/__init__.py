"""Expression stills in the moved picture: which ones show, in what light, and where."""
