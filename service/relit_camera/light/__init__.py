"""Light: panorama files, light maps, lamps, and the store of named environments.

A light map is float32 (32, 64, 3), linear RGB radiance in map axes (`light.directions`). A panorama is the same light
at a file's resolution. Energy Σ E·ω is kept: by resampling exactly, by rotation within 1 % for any lamp.

    directions.py                directions, azimuth and elevation, and the texels of the light map
    light_map.py                 the light map: resampling, total energy, irradiance
    light_map_interpolation.py   interpolation that conserves energy, poles included; splatting point lights
    light_map_rotation.py        the light map as a turned head or environment sees it
    spherical_harmonics.py       projection onto spherical harmonics, and back
    panorama_axes.py             axes of panoramas, and the ways between them
    environment_panorama.py      panorama files, checked and turned into map axes; environments
    environment_store.py         named environments: built in, and in the user's data folder
    environment_thumbnail.py     thumbnails of environments
    background_light.py          an environment guessed from an ordinary picture behind the person
    scene_light.py               light on the face: environment, rotation, saturation, lamps
    exposure.py                  the scale at which a relit picture is shown
    builtin/                     six painted environments
"""
