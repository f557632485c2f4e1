"""Pictures of the mannequin: camera, visibility and light."""
