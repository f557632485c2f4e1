"""Light: panorama files, light maps, lamps, and the store of named environments.

A light map is float32 (32, 64, 3), linear RGB radiance in map axes (`light.directions`). A panorama is the same light
at a file's resolution. Energy Σ E·ω is kept: by resampling exactly, by rotation within 1 % for any lamp.

    panorama.py    files in, checked and turned into map axes
    maps.py        resample, rotate, irradiance
    sphere.py      interpolation on the map that conserves energy, poles included
    lamps.py       round lamps
    exposure.py    the scale at which a picture is shown
    tone.py        thumbnails
    builtin/       six environments of our own, computed
    environment.py, store.py   an environment and where named ones are kept
    backdrop.py    an environment from an ordinary picture seen behind the person
    room.py        what falls on the face: environment, rotation, saturation, lamps
"""
