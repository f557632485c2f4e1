"""The API and the panel: how people and programs change the camera while it runs.

`app.create_app(camera, settings)` builds the application around whatever implements
`live.camera_control.CameraControl`; `server.serve(app, settings.server)` runs it in a thread. A request goes through
`security` (our names only, no other site), `access` (the token, where one is set), `bodies` (how long it may be) and
one function in `routes/`, which asks `live.scene.scene_controller` for another scene and answers with what now stands.
Nothing here touches the picture path: the worker reads the scene when it wants to.

    routes/            the operations, one file a topic
    schemas.py         bodies that `base.config.look` and `live.status.camera_status` do not have
    problems.py        every error as application/problem+json; error_handlers.py finds the problem for an exception
    security.py        Host, Origin, Sec-Fetch-Site, security headers
    access.py          the token and the login page
    connections.py     an end to clients that ask nothing or take nothing
    preview.py         each picture encoded once, however many look on
    presets.py         looks stored as YAML
    openapi.py         the description; schema_file.py writes it to docs/openapi.json
    panel/             the page: HTML, CSS and JavaScript modules, as they are served

docs/api.md tells users of it.
"""
