"""The REST API and the panel, by which people and programs change the camera while it runs. docs/api.md is for users.

`app.create_app(camera, settings)` builds the application around whatever implements
`live.camera_control.CameraControl`; `server.http_server.start_api_server` runs it in a thread. A request passes
`middleware/` (known host and no other site, then the token, then the length of the body) and reaches one function in
`routes/`. That function asks the scene controller for another scene and answers with the new state. Nothing here is in
the path of the pictures: the pipeline reads the scene once a frame.

    app.py              the application: routes, middleware, panel
    dependencies.py     what every route function receives
    schemas.py          bodies of requests and answers
    problem_details.py  errors as application/problem+json (RFC 9457)
    preview_stream.py   motion JPEG: each picture is encoded once for all viewers of one size
    jpeg_responses.py   single pictures, with caching by ETag
    routes/             the operations, one file a topic
    middleware/         same-origin checks, token, limits of bodies, errors
    server/             uvicorn in a thread, and timeouts for idle connections
    openapi/            the OpenAPI document, and its export to docs/openapi.json
    panel/              the page: HTML, CSS and JavaScript modules, as they are served
"""
