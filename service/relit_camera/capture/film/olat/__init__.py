"""Pictures of the head under one flash each: cropped, gains and room light removed, matted, brought to distant light.

OLAT ("one light at a time", Debevec et al. 2000) is the field's word for such a set of pictures.
"""
