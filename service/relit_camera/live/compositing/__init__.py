"""The final picture: person over background, in the colours of a display.

`display` turns scene-referred light into sRGB, `matte` finds the person in a live frame, `background` makes what stands
behind, `composite` puts one over the other. `sheet` lays pictures of record side by side for a person to look at.
"""
