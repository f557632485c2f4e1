"""Which frames of a video does a blinking light shine on: its clock and the camera's shutter found from brightness.

`brightness` watches the video once, `signal` makes one curve of it, `frequency` and `clock` find when the light is on,
`classify` calls frames bright, dark, partial or rejected. `thesis` is the recipe of thesis 4.3.2, for comparison.
"""
