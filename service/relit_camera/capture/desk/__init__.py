"""A subject from the light of the person's own screen: patches that light up in patterns before a webcam."""
