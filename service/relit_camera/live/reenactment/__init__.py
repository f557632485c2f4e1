"""Face motion → moved picture: reenactors behind one interface."""
