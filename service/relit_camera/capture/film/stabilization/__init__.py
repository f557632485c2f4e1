"""How the face moves: for every frame of a film, the rigid transform to a reference frame (thesis 4.3.3).

Corners are tracked through the dark frames (`corner_tracking`), the face is cropped accordingly (`face_crops`), and the
crops are aligned by their pixels (`refinement`); `film_stabilization` does it all for a film.
"""
