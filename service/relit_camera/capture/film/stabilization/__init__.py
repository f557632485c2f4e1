"""Where the face went: for every frame the rigid transform that takes it to the reference (thesis 4.3.3).

`sparse` follows corners over the dark frames, `dense` aligns what they see to their mean, `predicted` aligns pictures
under different light to what the others predict; `stabilise` does it for a video.
"""
